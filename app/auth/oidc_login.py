"""Signs people in at the identity provider: each attempt is bound to one browser and used once.

What is under way is kept in this process, like invitations: ten minutes, and the newest thousand.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hmac import compare_digest
from threading import Lock

from cachetools import LRUCache

from app.auth.accounts import TooManyAttempts
from app.auth.identities import Identities
from app.auth.next_url import safe_next_url
from app.auth.rate_limits import Buckets
from app.auth.sessions import Origin, SessionService
from harness.contracts import identity
from harness.contracts.ids import sha256
from harness.contracts.reasons import because, plain

MOST_UNDER_WAY = 1000
STARTS_PER_S, STARTS_AT_ONCE = 0.5, 20.0

UNDER_WAY_S = 600
"""How long a sign-in at the identity provider may take, in seconds."""


@dataclass(frozen=True)
class LoginRedirect:
    """Where to send a browser, and the cookie by which it is known when it comes back."""

    url: str
    cookie: str


@dataclass(frozen=True)
class LoginResult:
    """The cookie of the new session, and the page to go to."""

    cookie: str
    page: str


@dataclass(frozen=True)
class _UnderWay:
    """One sign-in: its secrets, until when, where to afterwards, and the digest of the cookie that it will replace."""

    attempt: identity.SignInAttempt
    until_s: float
    page: str
    replaces: str


class OidcLogin:
    """Signs people in at the identity provider. `clock` gives wall seconds; `fresh` makes unguessable strings."""

    def __init__(
        self,
        provider: identity.IdentityProvider,
        identities: Identities,
        sessions: SessionService,
        *,
        clock: Callable[[], float],
        fresh: Callable[[], str],
    ) -> None:
        self.provider, self.identities = provider, identities
        self._sessions, self._clock, self._fresh = sessions, clock, fresh
        self._starts = Buckets(per_s=STARTS_PER_S, burst=STARTS_AT_ONCE, clock=clock)
        self._under_way: LRUCache[str, _UnderWay] = LRUCache(MOST_UNDER_WAY)
        self._lock = Lock()

    def begin(self, page: str, origin: Origin, *, session: str) -> LoginRedirect | TooManyAttempts:
        """`session`: the cookie that the browser has now, if any. Raises SignInRefused."""
        wait_s = self._starts.wait_s(origin.source)
        if wait_s:
            return TooManyAttempts(wait_s)
        attempt = identity.SignInAttempt(state=self._fresh(), nonce=self._fresh(), verifier=self._fresh())
        url, cookie = self.provider.begin(attempt), self._fresh()
        with self._lock:
            self._under_way[sha256(cookie.encode())] = _UnderWay(
                attempt, self._clock() + UNDER_WAY_S, safe_next_url(page), sha256(session.encode()) if session else ""
            )
        return LoginRedirect(url, cookie)

    def finish(self, cookie: str, answer: Mapping[str, str], origin: Origin) -> LoginResult:
        """Finish a sign-in with the parameters of the redirect. Raises SignInRefused; the audit log says why."""
        with self._lock:
            pending = self._under_way.pop(sha256(cookie.encode()), None)
        if pending is None:
            raise identity.StateMismatch(because("sign_in_not_begun"))
        try:
            name = self._recognised(pending, answer, origin)
        except identity.SignInRefused as error:
            self._note("sign_in.issuer_refused", "", f"{error.code} {plain(error.where)}", origin)
            raise
        self._note("sign_in.accepted", name, f"identity provider {self.provider.issuer}", origin)
        if pending.replaces:
            self._sessions.accounts.store.close_sessions(digest=pending.replaces)
        return LoginResult(self._sessions.admit(name, origin), pending.page)

    def _recognised(self, pending: _UnderWay, answer: Mapping[str, str], origin: Origin) -> str:
        """The name of the account that the person has here."""
        if self._clock() >= pending.until_s or not compare_digest(
            answer.get("state", "").encode(), pending.attempt.state.encode()
        ):
            raise identity.StateMismatch(because("sign_in_answer_foreign"))
        code = answer.get("code", "")
        if "error" in answer or not code:
            raise identity.IssuerDeclined(because("issuer_declined"), where=answer.get("error", "")[:60])
        claims = self.provider.finish(
            pending.attempt, code=code, issuer=answer.get("iss", ""), by_groups=self._by_groups
        )
        return self.identities.account_of(claims, source=origin.source).name

    def _by_groups(self, subject: str) -> bool:
        return self.identities.by_groups(self.provider.issuer, subject)

    def _note(self, kind: str, name: str, detail: str, origin: Origin) -> None:
        accounts = self._sessions.accounts
        account = accounts.store.account(name) if name else None
        accounts.store.record(
            at_s=self._clock(),
            kind=kind,
            actor=name,
            role="+".join(account.roles) if account else "",
            subject=name,
            detail=detail.strip(),
            source=origin.source,
        )
