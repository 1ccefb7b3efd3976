"""/api/v1/account, /accounts and /tokens: the caller, all accounts, and tokens of robots and integrations."""

from typing import Any

from app.acts.accounts import AddAccountAct, ChangeAccountAct, IssueTokenAct
from app.acts.base import Slug
from app.auth.permissions import GRANTS
from app.console import ConsoleDep
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.routes.account import changed, issued_token
from app.web.errors import problem
from app.web.security import PrincipalDep
from harness.contracts.values import Value

router = api_requests.router("people")


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
    return [account_resource(one) for one in console.sessions.accounts.store.accounts()]


@router.post("/accounts", status_code=201, responses=api_requests.answers(schemas.AccountResource, status=201))
def add(console: ConsoleDep, principal: PrincipalDep, body: AddAccountAct) -> Any:
    """Add somebody; admins only."""
    return account_resource(
        console.sessions.accounts.add(body.name, roles=body.roles, password=body.password, by=principal)
    )


@router.patch("/accounts/{name}", responses=api_requests.answers(schemas.AccountResource))
def change(console: ConsoleDep, principal: PrincipalDep, name: Slug, body: ChangeAccountAct) -> Any:
    """Other roles, off and on, a new password; ends that person's sessions. Admins only."""
    return account_resource(changed(console, principal, name, body))


@router.get("/tokens", responses=api_requests.answers(schemas.TokenResource, many=True))
def tokens(console: ConsoleDep, principal: PrincipalDep) -> Any:
    """Every token, without its secret; admins only."""
    principal.acting("people")
    return [listed(one) for one in console.sessions.accounts.store.tokens()]


@router.post("/tokens", status_code=201, responses=api_requests.answers(schemas.IssuedToken, status=201))
def issue(console: ConsoleDep, principal: PrincipalDep, body: IssueTokenAct) -> Any:
    """Make a token. Its secret is in this answer and nowhere else. Admins only."""
    issued = issued_token(console, principal, body)
    return api_requests.plain(schemas.IssuedToken(**listed(issued.token), token=issued.secret))


@router.delete("/tokens/{token_id}", responses=api_requests.answers(schemas.TokenResource))
def revoke(console: ConsoleDep, principal: PrincipalDep, token_id: Slug) -> Any:
    """End a token at once. Admins only."""
    return listed(console.sessions.accounts.revoke(token_id, by=principal))


@router.post("/sign-in-links", status_code=201, responses=api_requests.answers(schemas.SignInLink, status=201))
def sign_in_link(console: ConsoleDep, principal: PrincipalDep) -> Any:
    """A fresh one-time link instead of every unused one; refused once there are accounts. Admins only."""
    principal.acting("people")
    if console.sessions.has_accounts:
        text = "There are accounts, so a one-time link lets nobody in."
        do = "sign in with an account, or give somebody a new password with `regen account password NAME`"
        return problem(409, code="accounts_exist", title="Refused", detail=text, do=do)
    return api_requests.plain(
        schemas.SignInLink(url=f"{console.settings.address}{console.sessions.invite(by=principal)}")
    )


def account_resource(account: Value) -> dict[str, Any]:
    """An account without its hash."""
    return {name: getattr(account, name) for name in schemas.AccountResource.__struct_fields__}


def listed(token: Value) -> dict[str, Any]:
    """A token without its digest."""
    return {name: getattr(token, name) for name in schemas.TokenResource.__struct_fields__}
