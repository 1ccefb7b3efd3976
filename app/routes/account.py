"""/account: one's own password and sessions; /account/people: everybody's, for an admin."""

from collections.abc import Sequence

from fastapi import APIRouter, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.auth.permissions import Principal
from app.console import Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.views import account
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid

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


@router.get("/people")
def people(console: ConsoleDep, principal: PrincipalDep) -> HTMLResponse:
    principal.acting("people")
    return render("account/people.html", _people(console, principal))


@router.post("/people")
async def add(request: Request, console: ConsoleDep, principal: PrincipalDep, typed: FormDep) -> Response:
    """The first account takes the place of the first link: its bearer signs in with the account from then on."""
    roles = [str(value) for name, value in (await request.form()).multi_items() if name == "roles"]
    name = typed.get("name", "").strip().lower()
    try:
        console.sessions.accounts.add(name, roles=roles, password=typed.get("password", ""), by=principal)
    except (ContractInvalid, ConcurrencyConflict) as error:
        page = _people(console, principal, errors=(explained(error),), typed=name)
        return render("account/people.html", page, status=422)
    return RedirectResponse("/account/sign-in" if principal.invited else "/account/people", status_code=303)


@router.post("/people/{name}")
async def change(request: Request, console: ConsoleDep, principal: PrincipalDep, name: str) -> Response:
    """Other roles, off, on, or a new password for somebody who forgot theirs: `do` names which."""
    form = await request.form()
    roles = [str(value) for field, value in form.multi_items() if field == "roles"]
    accounts, act = console.sessions.accounts, form.get("do", "roles")
    try:
        if act == "password":
            accounts.reset_password(name, new=str(form.get("password", "")), by=principal)
        elif act == "roles":
            accounts.change(name, roles=roles, by=principal)
        else:
            accounts.change(name, disabled=act == "disable", by=principal)
    except ContractInvalid as error:
        return render("account/people.html", _people(console, principal, errors=(explained(error),)), status=422)
    return RedirectResponse("/account/people", status_code=303)


@router.post("/tokens")
async def issue(request: Request, console: ConsoleDep, principal: PrincipalDep, typed: FormDep) -> Response:
    """The answer shows the token, once."""
    scopes = [str(value) for name, value in (await request.form()).multi_items() if name == "scopes"]
    try:
        issued = console.sessions.accounts.issue(
            typed.get("name", "").strip().lower(), scopes=scopes, robot_id=typed.get("robot_id", ""), by=principal
        )
    except ContractInvalid as error:
        return render("account/people.html", _people(console, principal, errors=(explained(error),)), status=422)
    return render("account/people.html", _people(console, principal, secret=issued.secret), status=201)


@router.post("/tokens/{token_id}/revoke")
def revoke(console: ConsoleDep, principal: PrincipalDep, token_id: str) -> Response:
    console.sessions.accounts.revoke(token_id, by=principal)
    return RedirectResponse("/account/people", status_code=303)


def _own(console: Console, principal: Principal, *, errors: Sequence[str] = (), done: str = "") -> HTMLResponse:
    shell = console.shell(N_("Your account"), "account", principal.actor)
    sessions = console.sessions.accounts.sessions_of(principal)
    elsewhere = any(one.by_groups for one in console.sessions.accounts.store.identities(principal.name))
    page = account.account_page(shell, principal, sessions, by_password=not elsewhere, errors=errors, done=done)
    return render("account/index.html", page, status=422 if errors else 200)


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
        robots=tuple(console.settings.robots),
        errors=tuple(errors),
        secret=secret,
        typed=typed,
    )
