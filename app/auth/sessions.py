"""Signs people and programs in (one-time link, password, integration token, owner token) and keeps their sessions.

The identity provider's way in is app/auth/oidc_login.py, which lets people through here.

A session is a random cookie whose digest is stored. It is exchanged for a fresh one every ROTATE_S; the old one stays
good until GRACE_S after the new one was first used, so that no request under way is turned away.
"""

import hmac
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Event, Lock

from msgspec.structs import replace

from app.auth.accounts import Accounts, TooManyAttempts
from app.auth.permissions import HOST_PREFIX, NotPermitted, Principal
from harness.adapters.stores.accounts_rows import Session
from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import sha256
from harness.contracts.reasons import because

INVITATION_S = 3600.0
ROTATE_S, GRACE_S, SEEN_S = 900.0, 60.0, 30.0
INVITED_ROLES = ("operator", "reviewer", "releaser", "admin")
LOGIN_PREFIX = "regen_login_"
"""Before the cookie of a session that somebody opened at a terminal."""


@dataclass(frozen=True)
class Origin:
    """The address of a browser and the name it gives itself."""

    source: str = ""
    agent: str = ""


class SessionService:
    """Signs people in and authenticates requests. `clock` gives wall seconds; `fresh` makes unguessable strings."""

    def __init__(
        self,
        accounts: Accounts,
        *,
        owner_token: str,
        operator: str,
        owner: str = "owner",
        limits: tuple[float, float],
        clock: Callable[[], float],
        fresh: Callable[[], str],
    ) -> None:
        """`limits`: seconds of idleness and of age after which a session is over."""
        self.accounts = accounts
        self._owner, self._operator, self._owner_name = owner_token.encode(), operator, owner
        self._idle_s, self._age_s = limits
        self._clock, self._fresh = clock, fresh
        self._invitations: dict[str, float] = {}
        self.entered = Event()
        self._unwritable_until_s = 0.0
        self._lock = Lock()

    @property
    def has_accounts(self) -> bool:
        return self.accounts.store.any_account()

    def invite(self, *, by: Principal | None = None) -> str:
        """A path that signs one person in, once, within an hour, while nobody has an account.

        Asked for `by` somebody it takes the place of every unused one, and stands in the trail.
        """
        token = self._fresh()
        if by is not None:
            self.accounts.note(by, "sign_in.link_made", subject=self._operator)
        with self._lock:
            if by is not None:
                self._invitations.clear()
            self._invitations[sha256(token.encode())] = self._clock() + INVITATION_S
        return f"/account/sign-in?token={token}"

    def key(self) -> str:
        """A one-use key for a form."""
        return self._fresh()

    def enter(self, token: str, origin: Origin = Origin()) -> str | None:
        """The new session's cookie for a fresh invitation; None for a used, late or unknown one, or with accounts."""
        with self._lock:
            until_s = self._invitations.pop(sha256(token.encode()), 0.0)
        if self._clock() >= until_s or self.has_accounts:
            return None
        principal = Principal(name=self._operator, roles=INVITED_ROLES, source=origin.source)
        self.accounts.note(principal, "sign_in.link", subject=self._operator)
        return self._open(self._operator, origin, invited=True)

    def sign_in(self, name: str, password: str, origin: Origin) -> str | TooManyAttempts | None:
        """A fresh cookie for the right password; None for a wrong one, Throttled after too many."""
        found = self.accounts.check(name, password, source=origin.source)
        return found if found is None or isinstance(found, TooManyAttempts) else self._open(name, origin, invited=False)

    def terminal_sign_in(self, name: str, password: str, origin: Origin) -> str | TooManyAttempts | None:
        """The same for a terminal: a token that is good as long as its session; it counts among the person's own."""
        cookie = self.sign_in(name, password, origin)
        return f"{LOGIN_PREFIX}{cookie}" if isinstance(cookie, str) else cookie

    def terminal_token(self, principal: Principal) -> str:
        """A token for a terminal of whoever is signed in with an account here; its session is one of their own.

        For people without a password: they come by the identity provider. Raises NotPermitted for anybody else.
        """
        if not principal.session or principal.invited:
            raise NotPermitted(because("terminal_needs_account"), where=principal.name)
        self.accounts.note(principal, "sign_in.terminal_token", subject=principal.name)
        return f"{LOGIN_PREFIX}{self._open(principal.name, Origin('terminal', 'command line'), invited=False)}"

    def admit(self, name: str, origin: Origin) -> str:
        """A fresh cookie for somebody whom the identity provider named."""
        return self._open(name, origin, invited=False)

    def who(self, cookie: str, *, source: str = "", active: bool = True) -> Principal | None:
        """Whose session this is, with the roles they have now; None once it is idle or old or they are disabled.

        A request that a page makes by itself is not `active`: it does not keep a session from becoming idle. What is
        one, the doorkeeper says (app/web/security.py).
        """
        return self._of(sha256(cookie.encode()), source=source, active=active)

    def access(self, principal: Principal, *, authorization: str = "") -> "HeldAccess":
        """What an open stream of this principal asks while it lasts; `authorization` is the header it came with."""
        return HeldAccess(self, principal, authorization)

    def still(self, principal: Principal, *, authorization: str = "") -> Principal | None:
        """The same principal as they are now; None once their session, account, token or reading right is gone."""
        if principal.session:
            now = self._of(principal.session, source=principal.source, active=False)
        else:
            now = self.bearer(authorization, source=principal.source)
        return now if now is not None and now.may("read") else None

    def _of(self, digest: str, *, source: str, active: bool) -> Principal | None:
        """Whose session has this digest, or had it until its cookie was exchanged."""
        session = self.accounts.store.session(digest)
        if session is None or not self._lasts(session, digest):
            return None
        roles = self._roles(session)
        if not roles:
            self.accounts.store.close_sessions(digest=session.digest)
            return None
        self._record_use(session, digest, active=active)
        return Principal(
            name=session.name,
            roles=roles,
            source=source or session.source,
            session=session.digest,
            invited=session.invited,
        )

    def rotated(self, cookie: str) -> str | None:
        """A fresh cookie for the same session if this one has served ROTATE_S, else None."""
        digest, now_s = sha256(cookie.encode()), self._clock()
        session = self.accounts.store.session(digest)
        if session is None or session.digest != digest or now_s - session.rotated_at_s < ROTATE_S:
            return None
        fresh = self._fresh()
        then = replace(
            session,
            digest=sha256(fresh.encode()),
            previous=digest,
            previous_until_s=None,
            rotated_at_s=now_s,
        )
        with suppress(StoreUnavailable):
            return fresh if self.accounts.store.change_session(digest, then) else None
        return None

    def bearer(self, authorization: str, *, source: str) -> Principal | None:
        """Who `Bearer <token>` speaks for: somebody signed in at a terminal, a user of this machine, an integration.

        Whoever has the owner's token may read the data folder; that makes them nobody of its accounts.
        """
        scheme, _, token = authorization.partition(" ")
        if scheme.lower() != "bearer":
            return None
        if self._owner and hmac.compare_digest(token.encode(), self._owner):
            return Principal(name=f"{HOST_PREFIX}{self._owner_name}", source=source, host=True)
        if token.startswith(LOGIN_PREFIX):
            return self.who(token.removeprefix(LOGIN_PREFIX), source=source)
        return self.accounts.holder(token, source=source)

    def leave(self, cookie: str) -> None:
        """Ends one session."""
        self.accounts.store.close_sessions(digest=sha256(cookie.encode()))

    def leave_terminal(self, token: str) -> None:
        """Ends the session that a terminal's token is of."""
        self.leave(token.removeprefix(LOGIN_PREFIX))

    def leave_everywhere(self, principal: Principal) -> int:
        """Ends all sessions of this person, this one too; how many there were."""
        self.accounts.note(principal, "sign_out.everywhere", subject=principal.name)
        return self.accounts.store.close_sessions(name=principal.name)

    def _open(self, name: str, origin: Origin, *, invited: bool) -> str:
        cookie, now_s = self._fresh(), self._clock()
        session = Session(
            digest=sha256(cookie.encode()),
            previous="",
            previous_until_s=None,
            name=name,
            invited=invited,
            began_at_s=now_s,
            seen_at_s=now_s,
            rotated_at_s=now_s,
            source=origin.source[:100],
            agent=origin.agent[:200],
        )
        self.accounts.store.open_session(session)
        self.entered.set()
        return cookie

    def _lasts(self, session: Session, digest: str) -> bool:
        now_s = self._clock()
        if now_s - session.seen_at_s > self._idle_s or now_s - session.began_at_s > self._age_s:
            with suppress(StoreUnavailable):
                self.accounts.store.close_sessions(digest=session.digest)
            return False
        superseded = digest == session.previous and now_s > (session.previous_until_s or now_s)
        return not superseded

    def _roles(self, session: Session) -> tuple[str, ...]:
        if session.invited:
            return () if self.has_accounts else INVITED_ROLES
        account = self.accounts.store.account(session.name)
        return account.roles if account and not account.disabled else ()

    def _record_use(self, session: Session, digest: str, *, active: bool) -> None:
        now_s = self._clock()
        first_use = digest == session.digest and bool(session.previous) and session.previous_until_s is None
        until_s = now_s + GRACE_S if first_use else session.previous_until_s
        seen_s = now_s if active and now_s - session.seen_at_s > min(SEEN_S, self._idle_s / 10) else session.seen_at_s
        if (first_use or seen_s != session.seen_at_s) and now_s >= self._unwritable_until_s:
            try:
                self.accounts.store.change_session(
                    session.digest, replace(session, previous_until_s=until_s, seen_at_s=seen_s)
                )
            except StoreUnavailable:
                self._unwritable_until_s = now_s + SEEN_S


class HeldAccess:
    """The access of one open stream. It follows a session over its changes of cookie, and ends with it."""

    def __init__(self, sessions: SessionService, principal: Principal, authorization: str) -> None:
        self._sessions, self._principal, self._authorization = sessions, principal, authorization

    def lasts(self) -> bool:
        """Whether the stream may go on; not where the accounts cannot be read."""
        try:
            now = self._sessions.still(self._principal, authorization=self._authorization)
        except StoreUnavailable:
            return False
        self._principal = now or self._principal
        return now is not None
