"""/account: one's own password and sessions; /account/people: all accounts, for an admin."""

from collections.abc import Sequence

from fastapi import APIRouter
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.accounts import AddAccountAct, ChangeAccountAct, IssueTokenAct
from app.auth.accounts import NewToken
from app.auth.permissions import Principal
from app.console import Console, ConsoleDep, FormDep, FormListsDep
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.views import account
from app.views.forms import Wrong
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid
from harness.contracts.values import Value

router = APIRouter(prefix="/account")


@router.get("")
def own(console: ConsoleDep, principal: PrincipalDep) -> HTMLResponse:
    return _own(console, principal)


@router.post("/password")
def password(console: ConsoleDep, principal: PrincipalDep, typed: FormDep) -> HTMLResponse:
    """Ends every other session of this person."""
    if typed.get("new", "") != typed.get("again", ""):
        return _own(console, principal, errors=(N_("The new password and its repetition differ."),))
    try:
        console.sessions.accounts.set_password(
            principal.name, old=typed.get("old", ""), new=typed.get("new", ""), by=principal, but=principal.session
        )
    except ContractInvalid as error:
        return _own(console, principal, errors=(explained(error),))
    return _own(console, principal, done=N_("Your password is changed. Your other browsers are signed out."))


@router.post("/terminal")
def terminal(console: ConsoleDep, principal: PrincipalDep) -> HTMLResponse:
    """The answer shows a token for `regen login --token-stdin`, once."""
    return _own(console, principal, token=console.sessions.terminal_token(principal))


@router.get("/people")
def people(console: ConsoleDep, principal: PrincipalDep) -> HTMLResponse:
    principal.acting("people")
    return render("account/people.html", _people(console, principal))


@router.post("/people")
def add(console: ConsoleDep, principal: PrincipalDep, typed: FormListsDep) -> Response:
    """The first account takes the place of the first link: its bearer signs in with the account from then on."""
    principal.acting("people")
    act = AddAccountAct.from_people(typed)
    name = next(iter(typed.get("name", ())), "").strip().lower()
    if isinstance(act, tuple):
        return _again(console, principal, act, typed=name)
    try:
        console.sessions.accounts.add(act.name, roles=act.roles, password=act.password, by=principal)
    except (ContractInvalid, ConcurrencyConflict) as error:
        return _again(console, principal, (Wrong("", explained(error)),), typed=name)
    return RedirectResponse("/account/sign-in" if principal.invited else "/account/people", status_code=303)


@router.post("/people/{name}")
def change(console: ConsoleDep, principal: PrincipalDep, name: str, typed: FormListsDep) -> Response:
    """Other roles, off, on, or a new password for somebody who forgot theirs: `do` names which."""
    principal.acting("people")
    act = ChangeAccountAct.from_people(typed)
    if isinstance(act, tuple):
        return _again(console, principal, act)
    try:
        changed(console, principal, name, act)
    except ContractInvalid as error:
        return _again(console, principal, (Wrong("", explained(error)),))
    return RedirectResponse("/account/people", status_code=303)


def changed(console: Console, principal: Principal, name: str, act: ChangeAccountAct) -> Value:
    """The account after it. Raises NotPermitted, UnknownName, or ContractInvalid for what cannot be."""
    accounts = console.sessions.accounts
    principal.acting("people")
    if act.roles is not None or act.disabled is not None:
        accounts.change(name, roles=act.roles, disabled=act.disabled, by=principal)
    if act.password is not None:
        accounts.reset_password(name, new=act.password, by=principal)
    return accounts.known(name)


@router.post("/tokens")
def issue(console: ConsoleDep, principal: PrincipalDep, typed: FormListsDep) -> Response:
    """The answer shows the token, once."""
    principal.acting("people")
    act = IssueTokenAct.from_people(typed)
    if isinstance(act, tuple):
        return _again(console, principal, act)
    try:
        issued = issued_token(console, principal, act)
    except ContractInvalid as error:
        return _again(console, principal, (Wrong("", explained(error)),))
    return render("account/people.html", _people(console, principal, secret=issued.secret), status=201)


def issued_token(console: Console, principal: Principal, act: IssueTokenAct) -> NewToken:
    """The new token with its secret. Raises ContractInvalid for a scope that only people may have."""
    return console.sessions.accounts.issue(
        act.name, scopes=act.scopes, robot_id=act.robot_id, days=act.days, by=principal
    )


def _again(console: Console, principal: Principal, wrong: Sequence[Wrong], *, typed: str = "") -> HTMLResponse:
    page = _people(console, principal, errors=[one.text for one in wrong], typed=typed)
    return render("account/people.html", page, status=422)


@router.post("/tokens/{token_id}/revoke")
def revoke(console: ConsoleDep, principal: PrincipalDep, token_id: str) -> Response:
    console.sessions.accounts.revoke(token_id, by=principal)
    return RedirectResponse("/account/people", status_code=303)


def _own(
    console: Console, principal: Principal, *, errors: Sequence[str] = (), done: str = "", token: str = ""
) -> HTMLResponse:
    shell = console.shell(N_("Your account"), "account", principal.actor)
    sessions = console.sessions.accounts.sessions_of(principal)
    elsewhere = any(one.by_groups for one in console.sessions.accounts.store.identities(principal.name))
    page = account.account_page(
        shell, principal, sessions, by_password=not elsewhere, errors=errors, done=done, token=token
    )
    return render("account/index.html", page, status=422 if errors else 201 if token else 200)


def _people(
    console: Console, principal: Principal, *, errors: Sequence[str] = (), secret: str = "", typed: str = ""
) -> account.PeoplePage:
    """Raises NotPermitted for anybody but an admin."""
    principal.acting("people")
    store, now_s = console.sessions.accounts.store, console.clock()
    accounts = store.accounts()
    known = {one.name: store.identities(one.name) for one in accounts}
    seen = {one.name: [session.seen_at_s for session in store.sessions(one.name)] for one in accounts}
    tokens = [
        account.TokenRow(
            token_id=one.token_id,
            name=one.name,
            scopes=", ".join(one.scopes),
            robot_id=one.robot_id,
            created_by=one.created_by,
            created_at_s=one.created_at_s,
            used_at_s=one.used_at_s,
            state="revoked"
            if one.revoked_at_s
            else "expired"
            if now_s >= (one.expires_at_s or now_s + 1)
            else N_("in use"),
        )
        for one in store.tokens()
    ]
    people = [
        account.Person(
            name=one.name,
            roles=account.role_choices(one.roles),
            disabled=one.disabled,
            created_at_s=one.created_at_s,
            last_seen_at_s=max(seen[one.name], default=None),
            by_groups=any(identity.by_groups for identity in known[one.name]),
            identities=tuple(f"{identity.subject} at {identity.issuer}" for identity in known[one.name]),
        )
        for one in accounts
    ]
    return account.PeoplePage(
        shell=console.shell(N_("People and tokens"), "account", principal.actor),
        first=not accounts,
        people=tuple(people),
        roles=account.role_choices(("admin", "operator") if not accounts else ("viewer",)),
        tokens=tuple(tokens),
        scopes=account.scope_choices(),
        robots=console.robots,
        errors=tuple(errors),
        secret=secret,
        typed=typed,
    )
