"""/api/v1/account, /accounts, /tokens: who one is, everybody's accounts, and keys for robots and integrations."""

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field
from starlette.responses import JSONResponse

from app.auth.permissions import GRANTS, ROLES, Permission, Role
from app.console import ConsoleDep
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.web.errors import problem
from app.web.security import PrincipalDep
from harness.contracts.values import Value

router = APIRouter(
    prefix="/api/v1",
    default_response_class=JSONResponse,
    responses=api_requests.PROBLEMS,
    dependencies=api_requests.CHECKED,
    tags=["people"],
)
Secret = Annotated[str, Field(min_length=12, max_length=256)]


class AccountBody(api_requests.RequestBody):
    """Somebody to add. The first account is an admin."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._\-]{0,39}$")]
    roles: Annotated[list[Role], Field(min_length=1, max_length=len(ROLES))]
    password: Secret


class ChangeBody(api_requests.RequestBody):
    """What changes about somebody; what is left out stays."""

    roles: Annotated[list[Role], Field(min_length=1, max_length=len(ROLES))] | None = None
    disabled: bool | None = None
    password: Secret | None = None


class TokenBody(api_requests.RequestBody):
    """A token to make. Without `robot_id` it speaks for any robot; without `days` it lasts until it is revoked."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._\-]{0,39}$")]
    scopes: Annotated[list[Permission], Field(min_length=1, max_length=len(GRANTS))]
    robot_id: api_requests.Text = ""
    days: Annotated[float, Field(gt=0, le=3650)] | None = None


@router.get("/account", responses=api_requests.answers(schemas.Caller))
def own(principal: PrincipalDep) -> Any:
    """Who this caller is, and what they may do."""
    return api_requests.plain(
        schemas.Caller(
            name=principal.name,
            roles=tuple(principal.roles),
            scopes=tuple(principal.scopes),
            robot_id=principal.robot_id or None,
            may=tuple(permission for permission in GRANTS if principal.may(permission)),
        )
    )


@router.get("/accounts", responses=api_requests.answers(schemas.AccountResource, many=True))
def accounts(console: ConsoleDep, principal: PrincipalDep) -> Any:
    """Everybody; admins only."""
    principal.acting("people")
    return [shown(one) for one in console.sessions.accounts.store.accounts()]


@router.post("/accounts", status_code=201, responses=api_requests.answers(schemas.AccountResource, status=201))
def add(console: ConsoleDep, principal: PrincipalDep, body: AccountBody) -> Any:
    """Add somebody; admins only."""
    return shown(console.sessions.accounts.add(body.name, roles=body.roles, password=body.password, by=principal))


@router.patch("/accounts/{name}", responses=api_requests.answers(schemas.AccountResource))
def change(console: ConsoleDep, principal: PrincipalDep, name: api_requests.Slug, body: ChangeBody) -> Any:
    """Other roles, off and on, a new password; ends that person's sessions. Admins only."""
    known = console.sessions.accounts
    principal.acting("people")
    if body.roles is not None or body.disabled is not None:
        known.change(name, roles=body.roles, disabled=body.disabled, by=principal)
    if body.password is not None:
        known.reset_password(name, new=body.password, by=principal)
    return shown(known.known(name))


@router.get("/tokens", responses=api_requests.answers(schemas.TokenResource, many=True))
def tokens(console: ConsoleDep, principal: PrincipalDep) -> Any:
    """Every token, without its secret; admins only."""
    principal.acting("people")
    return [listed(one) for one in console.sessions.accounts.store.tokens()]


@router.post("/tokens", status_code=201, responses=api_requests.answers(schemas.IssuedToken, status=201))
def issue(console: ConsoleDep, principal: PrincipalDep, body: TokenBody) -> Any:
    """Make a token. Its secret is in this answer and nowhere else. Admins only."""
    issued = console.sessions.accounts.issue(
        body.name, scopes=body.scopes, robot_id=body.robot_id, days=body.days, by=principal
    )
    return api_requests.plain(schemas.IssuedToken(**listed(issued.token), token=issued.secret))


@router.delete("/tokens/{token_id}", responses=api_requests.answers(schemas.TokenResource))
def revoke(console: ConsoleDep, principal: PrincipalDep, token_id: api_requests.Slug) -> Any:
    """End a token at once. Admins only."""
    return listed(console.sessions.accounts.revoke(token_id, by=principal))


@router.post("/sign-in-links", status_code=201, responses=api_requests.answers(schemas.SignInLink, status=201))
def sign_in_link(console: ConsoleDep, principal: PrincipalDep) -> Any:
    """A fresh one-time link instead of every unused one; refused once there are accounts. Admins only."""
    principal.acting("people")
    if console.sessions.has_accounts:
        told = "There are accounts, so a one-time link lets nobody in."
        do = "sign in with an account, or give somebody a new password with `regen account password NAME`"
        return problem(409, code="accounts_exist", title="Refused", detail=told, do=do)
    return api_requests.plain(
        schemas.SignInLink(url=f"{console.settings.address}{console.sessions.invite(by=principal)}")
    )


def shown(account: Value) -> dict[str, Any]:
    """An account without its hash."""
    return {name: getattr(account, name) for name in schemas.AccountResource.__struct_fields__}


def listed(token: Value) -> dict[str, Any]:
    """A token without its digest."""
    return {name: getattr(token, name) for name in schemas.TokenResource.__struct_fields__}
