"""regen account identity: links people of the identity provider to accounts; and the check of it in regen doctor."""

import stat
import time
from typing import Annotated, Any
from urllib.parse import urlsplit

import typer

from app.auth.identities import Identities
from app.auth.oidc_settings import identity_provider
from app.auth.permissions import ROLES
from app.cli.data_folder import opened
from app.cli.output import DEFAULT_DATA, Data, Json, show
from app.cli.person import here
from app.i18n.reasons.rendering import explained
from app.settings import ConsoleSettings
from harness.contracts.errors import HarnessError

READ_BY_OTHERS = stat.S_IRGRP | stat.S_IROTH


def identity(
    name: str,
    subject: Annotated[str, typer.Option(help="Who they are at the identity provider: its `sub` for them.")] = "",
    remove: Annotated[bool, typer.Option("--remove", help="Take that way in back, and sign them out.")] = False,
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
) -> None:
    """Let somebody with an account sign in at the identity provider too, with the roles of the account."""
    issuer = ConsoleSettings().oidc.issuer
    with opened(data) as accounts:
        identities = Identities(accounts, roles={}, clock=time.time)
        if remove:
            identities.unlink(name, by=here())
        else:
            identities.link(name, issuer=issuer, subject=subject, by=here())
    text = f"{name} signs in with a password alone." if remove else f"{name} may sign in as {subject} at {issuer}."
    show({"name": name, "issuer": issuer, "subject": subject}, as_json=as_json, lines=[text])


def examine_issuer(settings: ConsoleSettings, *, running: str = "") -> tuple[dict[str, Any] | None, list[str]]:
    """(what is set up, problems); None without an identity provider. Asks the provider for itself and its keys.

    `running` is the address of the console that has the data folder now, if one has.
    """
    if running and not settings.names:
        settings = settings.model_copy(update={"port": urlsplit(running).port})
    oidc = settings.oidc
    if not oidc.issuer:
        return None, []
    found: dict[str, Any] = {
        "issuer": oidc.issuer,
        "redirect": settings.back,
        "groups": {group: list(roles) for group, roles in oidc.roles.items()},
    }
    problems = [
        f"REGEN_OIDC_ROLES gives the group {group!r} the role {role!r}, which does not exist"
        for group, roles in oidc.roles.items()
        for role in roles
        if role not in ROLES
    ]
    if not oidc.roles:
        problems.append("REGEN_OIDC_ROLES is empty: only people whose account was linked come in by the provider.")
    file = oidc.client_secret_file
    if file is not None and file.exists() and file.stat().st_mode & READ_BY_OTHERS:
        problems.append(f"REGEN_OIDC_CLIENT_SECRET_FILE {file} can be read by others: chmod 600.")
    try:
        provider = identity_provider(settings, clock=time.time)
        found["keys"] = provider.examined() if provider else 0
    except HarnessError as error:
        problems.append(explained(error))
    if found.get("keys") == 0:
        problems.append(f"{oidc.issuer} publishes no key that it could sign with.")
    return found, problems
