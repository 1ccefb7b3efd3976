"""Rows of the accounts database as values: people, identities, sessions, tokens, audit entries, stored answers."""

from harness.contracts.values import Name, Value


class Account(Value):
    """One person. `secret` is the encoded argon2id hash, empty for who has no password; times are wall seconds."""

    name: Name
    roles: tuple[str, ...]
    secret: str
    disabled: bool
    created_at_s: float
    changed_at_s: float


class ExternalIdentity(Value):
    """A person at an identity provider. `by_groups`: their roles follow their groups there at every sign-in."""

    issuer: Name
    subject: str
    name: Name
    by_groups: bool
    linked_at_s: float


class Session(Value):
    """One signed-in browser, by the digests of its cookie. `previous` stays good until `previous_until_s`."""

    digest: str
    previous: str
    previous_until_s: float | None
    name: Name
    invited: bool
    began_at_s: float
    seen_at_s: float
    rotated_at_s: float
    source: str
    agent: str


class Token(Value):
    """One robot's or integration's key to the API, by digest. `robot_id` empty: any robot."""

    token_id: Name
    name: Name
    digest: str
    scopes: tuple[str, ...]
    robot_id: str
    created_by: Name
    created_at_s: float
    expires_at_s: float | None
    used_at_s: float | None
    revoked_at_s: float | None


class AuditEntry(Value):
    """One entry of the audit log. `subject` is the account, token or stream it is about; `source` an address."""

    number: int
    at_s: float
    kind: str
    actor: str
    role: str
    subject: str
    detail: str
    source: str
    previous: str
    digest: str


class StoredAnswer(Value):
    """The answer to a request with an idempotency key. `status` 0: begun, and its answer is not known."""

    caller: str
    key: str
    request: str
    begun_at_s: float
    status: int
    media_type: str
    body: bytes
