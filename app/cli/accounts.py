"""regen account and regen token: manage accounts and tokens, from the machine that the console runs on."""

from typing import Annotated, Any

import typer

from app.acts.accounts import AddAccountAct, ChangeAccountAct, IssueTokenAct
from app.auth.permissions import ROLES, SCOPES
from app.cli import output
from app.cli.api import api_without_robots
from app.cli.data_folder import opened
from app.cli.owner_api import owner_api
from harness.adapters.stores.accounts_rows import Account, Token
from harness.contracts.errors import StoreUnavailable
from harness.contracts.reasons import because

account = typer.Typer(no_args_is_help=True, help="People who may use the console.")
token = typer.Typer(no_args_is_help=True, help="Tokens for robots and integrations on the API.")
FromStdin = Annotated[bool, typer.Option("--password-stdin", help="Read the password from standard input.")]


@account.command("add")
def add(
    name: str,
    role: Annotated[list[str], typer.Option(help=f"One of {', '.join(ROLES)}; may be given again.")],
    data: output.Data = output.DEFAULT_DATA,
    password_stdin: FromStdin = False,
    as_json: output.Json = False,
) -> None:
    """Add somebody. The first account must be an admin; from then on one-time links let nobody in."""
    act = AddAccountAct.of(name=name, roles=role, password=output.password(confirmed=True, from_stdin=password_stdin))
    with api_without_robots(data) as api:
        added = api.post("/accounts", act.body())
    output.show(added, as_json=as_json, lines=[f"{added['name']} may sign in as {', '.join(added['roles'])}."])


@account.command("link")
def link(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Print a new one-time sign-in link of the console that runs on this folder, while nobody has an account.

    It lets one person in within an hour; links that were not used before open nothing any more.
    """
    owner = owner_api(data)
    if owner is None:
        raise StoreUnavailable(because("no_console_to_link"), where=str(data))
    made = owner.post("/sign-in-links", {})
    output.show(made, as_json=as_json, lines=[f"Sign in once: {made['url']}"])


@account.command("list")
def people(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """List all accounts, disabled ones too."""
    with opened(data) as accounts:
        rows = [_person(one) for one in accounts.store.accounts()]
    lines = output.table([[r["name"], ", ".join(r["roles"]), "disabled" if r["disabled"] else ""] for r in rows])
    output.show({"accounts": rows}, as_json=as_json, lines=lines or ["Nobody has an account yet."])


@account.command("disable")
def disable(
    name: str,
    data: output.Data = output.DEFAULT_DATA,
    back: Annotated[bool, typer.Option("--undo", help="Let them in again.")] = False,
    as_json: output.Json = False,
) -> None:
    """Turn somebody away at once, in every browser; the last admin stays."""
    with api_without_robots(data) as api:
        changed = api.patch(f"/accounts/{name}", ChangeAccountAct.of(disabled=not back).body())
    output.show(
        changed, as_json=as_json, lines=[f"{name} is {'back' if back else 'disabled, and signed out everywhere'}."]
    )


@account.command("password")
def password(
    name: str, data: output.Data = output.DEFAULT_DATA, password_stdin: FromStdin = False, as_json: output.Json = False
) -> None:
    """Give somebody a new password and sign them out everywhere."""
    with api_without_robots(data) as api:
        act = ChangeAccountAct.of(password=output.password(confirmed=True, from_stdin=password_stdin))
        api.patch(f"/accounts/{name}", act.body())
    output.show({"name": name}, as_json=as_json, lines=[f"{name} has a new password."])


@token.command("create")
def create(
    name: str,
    scope: Annotated[list[str], typer.Option(help=f"One of {', '.join(sorted(SCOPES))}; may be given again.")],
    robot: Annotated[str, typer.Option(help="Only for this robot.")] = "",
    days: Annotated[float | None, typer.Option(help="Days until it expires.", min=0.001)] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Make a token and print it, once."""
    act = IssueTokenAct.of(name=name, scopes=scope, robot_id=robot, days=days)
    with api_without_robots(data) as api:
        issued = api.post("/tokens", act.body())
    lines = [issued["token"], f"{issued['token_id']} is shown this once: {', '.join(issued['scopes'])}."]
    output.show(issued, as_json=as_json, lines=lines)


@token.command("list")
def tokens(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Every token, without its secret."""
    with opened(data) as accounts:
        rows = [_listed(one) for one in accounts.store.tokens()]
    lines = output.table(
        [[r["token_id"], r["name"], ", ".join(r["scopes"]), r["robot_id"] or "any robot", r["state"]] for r in rows]
    )
    output.show({"tokens": rows}, as_json=as_json, lines=lines or ["There are no tokens."])


@token.command("revoke")
def revoke(token_id: str, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """End a token at once."""
    with api_without_robots(data) as api:
        revoked = api.delete(f"/tokens/{token_id}")
    output.show(revoked | {"state": "revoked"}, as_json=as_json, lines=[f"{token_id} opens nothing any more."])


def _person(one: Account) -> dict[str, Any]:
    return {"name": one.name, "roles": list(one.roles), "disabled": one.disabled, "created_at_s": one.created_at_s}


def _listed(one: Token) -> dict[str, Any]:
    return {
        "token_id": one.token_id,
        "name": one.name,
        "scopes": list(one.scopes),
        "robot_id": one.robot_id,
        "created_at_s": one.created_at_s,
        "expires_at_s": one.expires_at_s,
        "state": "revoked" if one.revoked_at_s else "in use",
    }
