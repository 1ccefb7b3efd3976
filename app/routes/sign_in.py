"""/account/sign-in and /account/oidc: sign in by one-time link, password or identity provider, and sign out."""

from math import ceil
from urllib.parse import quote

from fastapi import APIRouter, Request
from starlette.responses import RedirectResponse, Response

from app.auth.accounts import TooManyAttempts
from app.auth.next_url import OVERVIEW, safe_next_url
from app.auth.oidc_login import OidcLogin
from app.auth.sessions import Origin
from app.console import Console, ConsoleDep, FormDep
from app.i18n import languages
from app.i18n.messages import reasoned
from app.views.sign_in import (
    SignInPage,
    SignInRefusal,
    from_elsewhere,
    other_address,
    refusal_of,
    too_fast,
    too_often,
    wrong_password,
)
from app.web import security
from app.web.rendering import render
from harness.contracts.errors import UnknownName
from harness.contracts.identity import IssuerUnreachable, SignInRefused
from harness.contracts.reasons import because

router = APIRouter(prefix="/account")
NOBODY = SignInRefusal()


@router.get("/sign-in")
def sign_in(request: Request, console: ConsoleDep, token: str = "", page: str = "", left: bool = False) -> Response:
    """A page, not a redirect: a strict cookie is not sent along a navigation that another site began."""
    known = request.state.principal is not None
    cookie = console.sessions.enter(token, _origin(request)) if token else None
    if cookie:
        return _let_in(console, request, cookie)
    failed = bool(token) and not known
    html = _page(console, let_in=known, link_failed=failed, page=page, left=left)
    return _answer(html, status=403 if failed else 200)


@router.post("/sign-in")
def sign_in_by_password(request: Request, console: ConsoleDep, typed: FormDep) -> Response:
    name, page = typed.get("name", "").strip().lower(), typed.get("page", "")
    found = console.sessions.sign_in(name, typed.get("password", ""), _origin(request))
    if isinstance(found, TooManyAttempts):
        wait_s = ceil(found.wait_s)
        html = _page(console, refusal=too_often(wait_s), name=name, page=page)
        return _answer(html, status=429, wait_s=wait_s)
    if found is None:
        return _answer(_page(console, refusal=wrong_password(), name=name, page=page), status=403)
    console.sessions.leave(request.cookies.get(console.settings.cookie, ""))
    answer = RedirectResponse(safe_next_url(page), status_code=303)
    answer.headers.append(
        "set-cookie", security.cookie_line(console.settings.cookie, found, secure=console.settings.secure)
    )
    return answer


@router.get("/oidc")
def begin(request: Request, console: ConsoleDep, page: str = "") -> Response:
    """Redirect to the identity provider; only from the console's own sign-in page."""
    login, settings = _oidc_login(console), console.settings
    if not security.same_origin(request.headers, websocket=False):
        return _answer(_page(console, refusal=from_elsewhere(), page=page), status=403)
    if request.headers.get("host", "").lower() != settings.address.split("://", 1)[1].lower():
        return _answer(_page(console, refusal=other_address(settings.address), page=page), status=403)
    try:
        redirection = login.begin(page, _origin(request), session=request.cookies.get(settings.cookie, ""))
    except SignInRefused as error:
        return _refused(console, error, page=page)
    if isinstance(redirection, TooManyAttempts):
        wait_s = ceil(redirection.wait_s)
        return _answer(_page(console, refusal=too_fast(wait_s), page=page), status=429, wait_s=wait_s)
    answer = RedirectResponse(redirection.url, status_code=303)
    answer.headers.append(
        "set-cookie", security.passing_cookie(settings.passing_cookie, redirection.cookie, secure=settings.secure)
    )
    return answer


@router.get("/oidc/back")
def back(request: Request, console: ConsoleDep) -> Response:
    """The redirect target of the identity provider: signs the person in or says why not, and ends the attempt."""
    login, settings = _oidc_login(console), console.settings
    cookie = request.cookies.get(settings.passing_cookie, "")
    try:
        session = login.finish(cookie, dict(request.query_params), _origin(request))
        answer = _let_in(console, request, session.cookie, page=session.page)
    except SignInRefused as error:
        answer = _refused(console, error)
    if cookie:
        answer.headers.append(
            "set-cookie", security.passing_cookie(settings.passing_cookie, "", secure=settings.secure)
        )
    return answer


@router.get("/oidc/leave")
def leave(console: ConsoleDep) -> Response:
    """Redirect to the sign-out page of the identity provider, if it has one, after signing out here."""
    try:
        url = _oidc_login(console).provider.leave(f"{console.settings.address}/account/sign-in")
    except SignInRefused as error:
        return _refused(console, error)
    return RedirectResponse(url or "/account/sign-in", status_code=303)


@router.post("/sign-out")
def sign_out(request: Request, console: ConsoleDep) -> Response:
    console.sessions.leave(request.cookies.get(console.settings.cookie, ""))
    return _signed_out(console)


@router.post("/sign-out-everywhere")
def sign_out_everywhere(console: ConsoleDep, principal: security.PrincipalDep) -> Response:
    console.sessions.leave_everywhere(principal)
    return _signed_out(console)


def _oidc_login(console: Console) -> OidcLogin:
    if console.issuer is None:
        raise UnknownName(because("no_identity_provider"))
    return console.issuer


def _origin(request: Request) -> Origin:
    return Origin(source=security.source_of(request), agent=request.headers.get("user-agent", ""))


def _let_in(console: Console, request: Request, cookie: str, *, page: str = OVERVIEW) -> Response:
    """Set a fresh session cookie; a session that the browser had is ended and never reused."""
    console.sessions.leave(request.cookies.get(console.settings.cookie, ""))
    answer = _answer(_page(console, let_in=True, page=page, stays=False))
    answer.headers.append(
        "set-cookie", security.cookie_line(console.settings.cookie, cookie, secure=console.settings.secure)
    )
    return answer


def _signed_out(console: Console) -> Response:
    """The identity provider may still know this browser: the page says so where there is one."""
    left = "?left=true" if console.issuer else ""
    answer = RedirectResponse(f"/account/sign-in{left}", status_code=303)
    answer.headers.append(
        "set-cookie", security.cookie_line(console.settings.cookie, "", secure=console.settings.secure)
    )
    answer.headers["clear-site-data"] = '"cache", "storage"'
    return answer


def _refused(console: Console, error: SignInRefused, *, page: str = "") -> Response:
    refusal = refusal_of(error.code, what=reasoned(error.what), do=languages.remedy(error))
    status = 502 if isinstance(error, IssuerUnreachable) else 403
    return _answer(_page(console, refusal=refusal, page=page, stays=False), status=status)


def _page(
    console: Console,
    *,
    let_in: bool = False,
    link_failed: bool = False,
    refusal: SignInRefusal = NOBODY,
    name: str = "",
    page: str = "",
    left: bool = False,
    stays: bool = True,
) -> SignInPage:
    on = safe_next_url(page)
    return SignInPage(
        let_in=let_in,
        by_password=console.sessions.has_accounts,
        link_failed=link_failed,
        refusal=refusal,
        name=name[:40],
        page=on,
        page_query="" if on == OVERVIEW else f"?page={quote(on, safe='')}",
        provider=console.settings.oidc.name if console.issuer else "",
        left=left,
        stays=stays,
    )


def _answer(page: SignInPage, *, status: int = 200, wait_s: int = 0) -> Response:
    answer: Response = render("account/sign-in.html", page, status=status)
    if wait_s:
        answer.headers["retry-after"] = str(wait_s)
    return answer
