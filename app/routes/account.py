"""/account: sign in by a one-time link, sign out."""

from dataclasses import dataclass

from fastapi import APIRouter, Request
from starlette.responses import RedirectResponse, Response

from app.console import ConsoleDep
from app.rendering import render

router = APIRouter(prefix="/account")


@dataclass(frozen=True)
class SignInPage:
    """Whether the link let somebody in."""

    let_in: bool


@router.get("/sign-in")
def sign_in(request: Request, console: ConsoleDep, token: str = "") -> Response:
    """A page, not a redirect: a strict cookie is not sent along a navigation that another site began."""
    session = console.doors.enter(token)
    if session is None:
        known = console.doors.who(request.cookies.get(console.settings.cookie, ""))
        return render("account/sign-in.html", SignInPage(let_in=known is not None), status=200 if known else 403)
    answer = render("account/sign-in.html", SignInPage(let_in=True))
    answer.set_cookie(console.settings.cookie, session, httponly=True, samesite="strict", path="/")
    return answer


@router.post("/sign-out")
def sign_out(request: Request, console: ConsoleDep) -> Response:
    console.doors.leave(request.cookies.get(console.settings.cookie, ""))
    answer = RedirectResponse("/account/sign-in", status_code=303)
    answer.delete_cookie(console.settings.cookie, path="/")
    return answer
