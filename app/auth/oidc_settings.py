"""Builds the identity provider's client and login from the settings."""

from collections.abc import Callable

from app.auth.identities import Identities
from app.auth.oidc_login import OidcLogin
from app.auth.sessions import SessionService
from app.settings import ConsoleSettings
from harness.adapters.identity.openid import OpenIdProvider, Registration, secret_of


def identity_provider(settings: ConsoleSettings, *, clock: Callable[[], float]) -> OpenIdProvider | None:
    """The configured identity provider, or None; sends no request. Raises ContractInvalid for an invalid setting."""
    oidc = settings.oidc
    if not oidc.issuer:
        return None
    registration = Registration(
        issuer=oidc.issuer,
        client_id=oidc.client_id,
        back=settings.back,
        scopes=oidc.scopes,
        groups_claim=oidc.groups_claim,
        hosts=oidc.hosts,
        authority=oidc.authority,
    )
    secret = secret_of(oidc.client_secret.get_secret_value(), oidc.client_secret_file)
    return OpenIdProvider(registration, secret=secret, clock=clock)


def oidc_login(
    settings: ConsoleSettings, sessions: SessionService, *, clock: Callable[[], float], fresh: Callable[[], str]
) -> OidcLogin | None:
    """The login at the identity provider, or None without one. Raises ContractInvalid for settings or unknown roles."""
    provider = identity_provider(settings, clock=clock)
    if provider is None:
        return None
    identities = Identities(sessions.accounts, roles=settings.oidc.roles, clock=clock)
    return OidcLogin(provider, identities, sessions, clock=clock, fresh=fresh)
