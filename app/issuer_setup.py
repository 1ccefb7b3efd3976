"""The identity provider as the settings name it, and the door for those who come from there."""

from collections.abc import Callable

from app.doors import Doors
from app.identities import Identities
from app.issuer_door import IssuerDoor
from app.settings import ConsoleSettings
from harness.adapters.identity.openid import OpenIdProvider, Registration, secret_of


def identity_provider(settings: ConsoleSettings, *, clock: Callable[[], float]) -> OpenIdProvider | None:
    """The one that is set up, if any; nobody is asked yet. Raises ContractInvalid for a setting that cannot be."""
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


def issuer_door(
    settings: ConsoleSettings, doors: Doors, *, clock: Callable[[], float], fresh: Callable[[], str]
) -> IssuerDoor | None:
    """None without an identity provider. Raises ContractInvalid as above, and for roles that do not exist."""
    provider = identity_provider(settings, clock=clock)
    if provider is None:
        return None
    identities = Identities(doors.accounts, roles=settings.oidc.roles, clock=clock)
    return IssuerDoor(provider, identities, doors, clock=clock, fresh=fresh)
