"""/api/v1/account, /accounts, /tokens: who one is, everybody's accounts, and keys for robots and integrations."""

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field
from starlette.responses import JSONResponse

from app.console import ConsoleDep
from app.errors import problem
from app.permissions import GRANTS, ROLES, Permission, Role
from app.routes import api_schemas as schemas
from app.routes.api_words import CHECKED, PROBLEMS, Body, Slug, Text, answers, plain
from app.security import VisitorDep
from harness.contracts.values import Value

router = APIRouter(
    prefix="/api/v1", default_response_class=JSONResponse, responses=PROBLEMS, dependencies=CHECKED, tags=["people"]
)
Secret = Annotated[str, Field(min_length=12, max_length=256)]


class AccountBody(Body):
    """Somebody to add. The first account is an admin."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._\-]{0,39}$")]
    roles: Annotated[list[Role], Field(min_length=1, max_length=len(ROLES))]
    password: Secret


class ChangeBody(Body):
    """What changes about somebody; what is left out stays."""

    roles: Annotated[list[Role], Field(min_length=1, max_length=len(ROLES))] | None = None
    disabled: bool | None = None
    password: Secret | None = None


class TokenBody(Body):
    """A token to make. Without `robot_id` it speaks for any robot; without `days` it lasts until it is revoked."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._\-]{0,39}$")]
    scopes: Annotated[list[Permission], Field(min_length=1, max_length=len(GRANTS))]
    robot_id: Text = ""
    days: Annotated[float, Field(gt=0, le=3650)] | None = None


@router.get("/account", responses=answers(schemas.Caller))
def own(visitor: VisitorDep) -> Any:
    """Who this caller is, and what they may do."""
    return plain(
        schemas.Caller(
            name=visitor.name,
            roles=tuple(visitor.roles),
            scopes=tuple(visitor.scopes),
            robot_id=visitor.robot_id or None,
            may=tuple(permission for permission in GRANTS if visitor.may(permission)),
        )
    )


@router.get("/accounts", responses=answers(schemas.Account, many=True))
def accounts(console: ConsoleDep, visitor: VisitorDep) -> Any:
    """Everybody; admins only."""
    visitor.acting("people")
    return [shown(one) for one in console.doors.accounts.store.accounts()]


@router.post("/accounts", status_code=201, responses=answers(schemas.Account, status=201))
def add(console: ConsoleDep, visitor: VisitorDep, body: AccountBody) -> Any:
    """Add somebody; admins only."""
    return shown(console.doors.accounts.add(body.name, roles=body.roles, password=body.password, by=visitor))


@router.patch("/accounts/{name}", responses=answers(schemas.Account))
def change(console: ConsoleDep, visitor: VisitorDep, name: Slug, body: ChangeBody) -> Any:
    """Other roles, off and on, a new password; ends that person's sessions. Admins only."""
    known = console.doors.accounts
    visitor.acting("people")
    if body.roles is not None or body.disabled is not None:
        known.change(name, roles=body.roles, disabled=body.disabled, by=visitor)
    if body.password is not None:
        known.reset_password(name, new=body.password, by=visitor)
    return shown(known.known(name))


@router.get("/tokens", responses=answers(schemas.Token, many=True))
def tokens(console: ConsoleDep, visitor: VisitorDep) -> Any:
    """Every token, without its secret; admins only."""
    visitor.acting("people")
    return [listed(one) for one in console.doors.accounts.store.tokens()]


@router.post("/tokens", status_code=201, responses=answers(schemas.IssuedToken, status=201))
def issue(console: ConsoleDep, visitor: VisitorDep, body: TokenBody) -> Any:
    """Make a token. Its secret is in this answer and nowhere else. Admins only."""
    issued = console.doors.accounts.issue(
        body.name, scopes=body.scopes, robot_id=body.robot_id, days=body.days, by=visitor
    )
    return plain(schemas.IssuedToken(**listed(issued.token), token=issued.secret))


@router.delete("/tokens/{token_id}", responses=answers(schemas.Token))
def revoke(console: ConsoleDep, visitor: VisitorDep, token_id: Slug) -> Any:
    """End a token at once. Admins only."""
    return listed(console.doors.accounts.revoke(token_id, by=visitor))


@router.post("/sign-in-links", status_code=201, responses=answers(schemas.SignInLink, status=201))
def sign_in_link(console: ConsoleDep, visitor: VisitorDep) -> Any:
    """A fresh one-time link instead of every unused one; refused once there are accounts. Admins only."""
    visitor.acting("people")
    if console.doors.has_accounts:
        told = "There are accounts, so a one-time link lets nobody in."
        do = "sign in with an account, or give somebody a new password with `regen account password NAME`"
        return problem(409, code="accounts_exist", title="Refused", detail=told, do=do)
    return plain(schemas.SignInLink(url=f"{console.settings.address}{console.doors.invite(by=visitor)}"))


def shown(account: Value) -> dict[str, Any]:
    """An account without its hash."""
    return {name: getattr(account, name) for name in schemas.Account.__struct_fields__}


def listed(token: Value) -> dict[str, Any]:
    """A token without its digest."""
    return {name: getattr(token, name) for name in schemas.Token.__struct_fields__}
