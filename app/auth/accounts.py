"""Stores people with their passwords and the tokens of integrations, and limits wrong passwords."""

import logging
import re
from base64 import b64encode
from collections import deque
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import Any

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from argon2.low_level import ARGON2_VERSION
from msgspec.structs import replace

from app.auth.permissions import ROLES, SCOPES, Principal
from app.i18n.catalogues import N_
from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.accounts_rows import Account, AuditEntry, Token
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid, StoreUnavailable, UnknownName
from harness.contracts.ids import sha256
from harness.contracts.reasons import Reason, because

LOG = logging.getLogger(__name__)
SHORTEST, LONGEST = 12, 256
PASSWORD_RULE = N_("A password has 12 to 256 characters, at least five different ones, and not the name in it.")
NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,39}")
FREE_TRIES, ADDRESS_TRIES, LONGEST_WAIT_S, REMEMBERED_S = 5, 20, 300.0, 3600.0
RECENT_S = 30.0
TOKEN_PREFIX = "regen_"


@dataclass(frozen=True)
class TooManyAttempts:
    """Too many wrong passwords: try again in `wait_s`."""

    wait_s: float


@dataclass(frozen=True)
class NewToken:
    """A new token. `secret` is shown this once and kept nowhere."""

    token: Token
    secret: str


class Accounts:
    """The accounts of this installation. `by` is who asks: changes need the permission `people`.

    `clock` gives wall seconds, `fresh` an unguessable string.
    """

    def __init__(
        self,
        store: SqlAccounts,
        *,
        clock: Callable[[], float],
        fresh: Callable[[], str],
        hasher: PasswordHasher | None = None,
    ) -> None:
        self.store, self._clock, self.fresh = store, clock, fresh
        self._hasher = hasher or PasswordHasher()
        self._nobody = _nobodys_hash(self._hasher)
        self._one_at_a_time, self._telling = Lock(), Lock()
        self._untold: deque[dict[str, Any]] = deque()

    # people ---------------------------------------------------------------------------------------------------------

    def add(self, name: str, *, roles: Collection[str], password: str, by: Principal) -> Account:
        """Raises ContractInvalid for a bad name, role or password, ConcurrencyConflict for a taken name."""
        by.acting("people")
        if not NAME.fullmatch(name):
            raise ContractInvalid(because("account_name_invalid"), where=because("at_name", name=name[:40]))
        if not self.store.any_account() and "admin" not in roles:
            raise ContractInvalid(because("first_account_not_admin"), where=because("at_roles", roles=tuple(roles)))
        now_s = self._clock()
        account = Account(
            name=name,
            roles=checked_roles(roles),
            secret=self._hasher.hash(_password(password, name=name)),
            disabled=False,
            created_at_s=now_s,
            changed_at_s=now_s,
        )
        self.store.add_account(account)
        self.note(by, "account.added", subject=name, detail=" ".join(account.roles))
        return account

    def change(
        self, name: str, *, roles: Collection[str] | None = None, disabled: bool | None = None, by: Principal
    ) -> None:
        """Change a person's roles, or disable or enable them; ends their sessions. The last admin cannot be removed."""
        by.acting("people")
        old = self.known(name)
        if roles is not None:
            self._own(name, because("roles_of_identity_provider", name=name))
        new = replace(
            old,
            roles=old.roles if roles is None else checked_roles(roles),
            disabled=old.disabled if disabled is None else disabled,
            changed_at_s=self._clock(),
        )
        others = (one for one in self.store.accounts() if one.name != name and not one.disabled)
        if (new.disabled or "admin" not in new.roles) and not any("admin" in one.roles for one in others):
            raise ContractInvalid(because("last_admin", name=name))
        self.store.change_account(new)
        self.store.close_sessions(name=name)
        state = "disabled" if new.disabled else "enabled"
        self.note(by, "account.changed", subject=name, detail=f"{' '.join(new.roles)}, {state}")

    def set_password(self, name: str, *, old: str, new: str, by: Principal, but: str = "") -> None:
        """Change one's own password, given the old one; ends one's other sessions, except the one with digest `but`."""
        if by.name != name or not self._matches(self.known(name), old):
            self.note(by, "password.refused", subject=name)
            raise ContractInvalid(because("password_wrong"), where=because("at_present_password"))
        self._store_password(name, new, by=by, but=but)

    def reset_password(self, name: str, *, new: str, by: Principal) -> None:
        """Set the password of another person, as an admin."""
        by.acting("people")
        self._store_password(name, new, by=by)

    def _store_password(self, name: str, new: str, *, by: Principal, but: str = "") -> None:
        self._own(name, because("password_of_identity_provider", name=name))
        secret = self._hasher.hash(_password(new, name=name))
        self.store.change_account(replace(self.known(name), secret=secret, changed_at_s=self._clock()))
        self.store.close_sessions(name=name, but=but)
        self.note(by, "password.changed", subject=name)

    def _own(self, name: str, matter: Reason) -> None:
        """Raises ContractInvalid, with `matter`, for somebody who is known by the identity provider's groups alone."""
        if any(one.by_groups for one in self.store.identities(name)):
            raise ContractInvalid(matter, where=name)

    def known(self, name: str) -> Account:
        account = self.store.account(name)
        if account is None:
            raise UnknownName(because("unknown_account", name=name[:40]))
        return account

    def check(self, name: str, password: str, *, source: str) -> Account | TooManyAttempts | None:
        """The account if the password is right, None if not, Throttled after too many. Unknown names cost the same."""
        with self._one_at_a_time:
            wait_s = self._wait_s(name, source)
            if wait_s > 0:
                return TooManyAttempts(wait_s)
            account = self.store.account(name[:200])
            right = self._matches(account, password) and account is not None and not account.disabled
            self.store.record(
                at_s=self._clock(),
                kind="sign_in.accepted" if right else "sign_in.refused",
                actor=name if right else "",
                role="+".join(account.roles) if account and right else "",
                subject=name,
                detail="",
                source=source,
            )
            return account if right else None

    def _matches(self, account: Account | None, password: str) -> bool:
        """Who has no password is checked against nobody's: the answer takes as long as any other."""
        secret = account.secret if account else ""
        try:
            right = self._hasher.verify(secret or self._nobody, password[: LONGEST + 1])
        except (VerificationError, InvalidHashError):
            return False
        return right and bool(secret)

    def _wait_s(self, name: str, source: str) -> float:
        now_s = self._clock()
        since_s = now_s - REMEMBERED_S
        waits = []
        for (count, last_s), free in (
            (self.store.refusals(since_s=since_s, name=name[:200]), FREE_TRIES),
            (self.store.refusals(since_s=since_s, source=source), ADDRESS_TRIES),
        ):
            pause_s = min(2.0 ** (count - free), LONGEST_WAIT_S) if count >= free else 0.0
            waits.append(last_s + pause_s - now_s)
        return max(waits)

    # tokens ---------------------------------------------------------------------------------------------------------

    def issue(
        self, name: str, *, scopes: Collection[str], by: Principal, robot_id: str = "", days: float | None = None
    ) -> NewToken:
        """A new token. Raises ContractInvalid for a scope that only people may have."""
        by.acting("people")
        wrong = sorted(set(scopes) - SCOPES)
        if wrong or not scopes or not NAME.fullmatch(name):
            raise ContractInvalid(
                because("token_name_or_scope_invalid", scopes=tuple(sorted(SCOPES))),
                where=because("at_token_scopes", name=name[:40], scopes=tuple(scopes) or ("none",)),
            )
        now_s, secret = self._clock(), TOKEN_PREFIX + self.fresh()
        digest = sha256(secret.encode())
        token = Token(
            token_id=f"tok_{digest[:12]}",
            name=name,
            digest=digest,
            scopes=tuple(sorted(scopes)),
            robot_id=robot_id[:200],
            created_by=by.name,
            created_at_s=now_s,
            expires_at_s=None if days is None else now_s + days * 86400.0,
            used_at_s=None,
            revoked_at_s=None,
        )
        self.store.add_token(token)
        self.note(
            by, "token.issued", subject=token.token_id, detail=f"{name}: {' '.join(token.scopes)} {robot_id}".strip()
        )
        return NewToken(token, secret)

    def revoke(self, token_id: str, *, by: Principal) -> Token:
        """Ends a token at once. Raises UnknownName."""
        by.acting("people")
        token = next((one for one in self.store.tokens() if one.token_id == token_id), None)
        if token is None:
            raise UnknownName(because("unknown_token", token_id=token_id[:40]))
        if token.revoked_at_s is None:
            token = replace(token, revoked_at_s=self._clock())
            self.store.change_token(token)
            self.note(by, "token.revoked", subject=token.token_id)
        return token

    def holder(self, secret: str, *, source: str) -> Principal | None:
        """Who a token speaks for; None for an unknown, revoked or expired one."""
        token = self.store.token(sha256(secret.encode())) if secret.startswith(TOKEN_PREFIX) else None
        now_s = self._clock()
        if token is None or token.revoked_at_s is not None or now_s >= (token.expires_at_s or now_s + 1):
            return None
        if now_s - (token.used_at_s or 0.0) > RECENT_S:
            with suppress(StoreUnavailable):
                self.store.change_token(replace(token, used_at_s=now_s))
        return Principal(name=token.name, scopes=token.scopes, source=source, robot_id=token.robot_id)

    # the trail ------------------------------------------------------------------------------------------------------

    def note(self, by: Principal, kind: str, *, subject: str, detail: str = "") -> AuditEntry:
        """Write one line to the audit log about what `by` did."""
        return self.store.record(
            at_s=self._clock(),
            kind=kind,
            actor=by.name,
            role=by.actor.role,
            subject=subject,
            detail=detail,
            source=by.source,
        )

    def record(self, by: Principal, actor: Actor, command: str, subject: str, outcome: str) -> None:
        """Write a person's command to the audit log, with its outcome and the address it came from.

        The command was decided before: where the audit log is held by another process, the entry waits for the next.
        """
        self._untold.append(
            {
                "at_s": self._clock(),
                "kind": f"command.{command}",
                "actor": actor.name,
                "role": actor.role,
                "subject": subject,
                "detail": outcome,
                "source": by.source,
            }
        )
        with self._telling:
            while self._untold:
                try:
                    self.store.record(**self._untold[0])
                except StoreUnavailable:
                    LOG.exception("audit_entry_waits command=%s actor=%s", command, actor.name)
                    return
                self._untold.popleft()

    def sessions_of(self, principal: Principal) -> Sequence[tuple[str, float, float, bool]]:
        """(from where, since, last seen, whether it is this one) of a person's open sessions."""
        return [
            (
                f"{one.source} {one.agent}".strip(),
                one.began_at_s,
                one.seen_at_s,
                principal.session in (one.digest, one.previous),
            )
            for one in self.store.sessions(principal.name)
        ]


def checked_roles(roles: Collection[str]) -> tuple[str, ...]:
    """In the order of the table of roles. Raises ContractInvalid for none, or one that does not exist."""
    unknown = sorted(set(roles) - set(ROLES))
    if unknown or not roles:
        raise ContractInvalid(
            because("account_without_role", roles=tuple(ROLES)), where=because("at_roles", roles=tuple(roles))
        )
    return tuple(role for role in ROLES if role in roles)


def _password(password: str, *, name: str) -> str:
    named = len(name) > 3 and name in password.lower()
    if not SHORTEST <= len(password) <= LONGEST or named or len(set(password)) < 5:
        raise ContractInvalid(
            because("password_weak", shortest=SHORTEST, longest=LONGEST), where=because("at_new_password")
        )
    return password


def _nobodys_hash(hasher: PasswordHasher) -> str:
    """What a name that nobody has is checked against: as much work to verify as a real hash, and none to make."""
    salt, digest = (b64encode(bytes(size)).decode().rstrip("=") for size in (hasher.salt_len, hasher.hash_len))
    work = f"m={hasher.memory_cost},t={hasher.time_cost},p={hasher.parallelism}"
    return f"$argon2id$v={ARGON2_VERSION}${work}${salt}${digest}"
