"""What a person or a program is told when something went wrong: a page, or a problem document (RFC 9457)."""

import json
from dataclasses import dataclass

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, Response
from starlette.types import Scope

from app.rendering import render
from harness.contracts.errors import (
    BlobDamaged,
    ConcurrencyConflict,
    ContractInvalid,
    HarnessError,
    LogDamaged,
    ProviderFailed,
    StoreUnavailable,
    UnknownName,
)

STATUS: tuple[tuple[type[HarnessError], int], ...] = (
    (UnknownName, 404),
    (ContractInvalid, 422),
    (ConcurrencyConflict, 409),
    (BlobDamaged, 404),
    (ProviderFailed, 502),
    (StoreUnavailable, 503),
    (LogDamaged, 500),
)


class PortBusy(HarnessError):
    """The console's port cannot be listened on."""

    code = "port_busy"


@dataclass(frozen=True)
class ErrorPage:
    """What happened, where, and what to do now."""

    status: int
    title: str
    what: str
    where: str
    do: str


REFUSALS = {
    "signed_out": (
        "You are not signed in",
        "This console answers only to people who were let in.",
        "Open the one-time link that `regen up` printed. If it was used already, start `regen up` again for another.",
    ),
    "cross_site": (
        "This request came from another page",
        "A command counts only if it comes from the console's own pages.",
        "Open the console itself and try again there.",
    ),
    "unknown_host": (
        "This console does not answer to that name",
        "It listens on this machine only.",
        "Open it as http://127.0.0.1 with the port that `regen up` printed.",
    ),
    "not_allowed": ("This address takes no commands", "Only reading is possible here.", "Go back to the overview."),
}


def problem(status: int, *, code: str, title: str, detail: str, do: str = "") -> Response:
    """One problem document; `code` is the slug for machines, `do` the sentence for people."""
    body = {"type": f"urn:regen:{code}", "title": title, "status": status, "detail": detail, "code": code, "do": do}
    return Response(json.dumps(body), status_code=status, media_type="application/problem+json")


def refused(scope: Scope, *, status: int, code: str) -> Response:
    """The doorkeeper's answer, in the language of the caller."""
    title, what, do = REFUSALS[code]
    if str(scope["path"]).startswith("/api/"):
        return problem(status, code=code, title=title, detail=what, do=do)
    return render("error.html", ErrorPage(status=status, title=title, what=what, where="", do=do), status=status)


def install(app: FastAPI) -> None:
    """Every failure that leaves a route becomes one of the two answers."""

    @app.exception_handler(HarnessError)
    def harness_error(request: Request, error: HarnessError) -> Response:
        status = next((number for kind, number in STATUS if isinstance(error, kind)), 500)
        return told(request, status=status, code=error.code, what=error.what, where=error.where, do=error.do)

    @app.exception_handler(RequestValidationError)
    def invalid(request: Request, error: RequestValidationError) -> Response:
        wrong = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors())
        return told(request, status=422, code="invalid", what="The request is not well formed", where=wrong, do="")

    @app.exception_handler(HTTPException)
    def http(request: Request, error: HTTPException) -> Response:
        what = "There is no such page" if error.status_code == 404 else str(error.detail)
        return told(request, status=error.status_code, code="http", what=what, where=request.url.path, do="")


def told(request: Request, *, status: int, code: str, what: str, where: str, do: str) -> Response:
    """One failure as a problem for /api/, else as a page."""
    if request.url.path.startswith("/api/"):
        return problem(status, code=code, title=what, detail=f"{what}. {where}".strip(), do=do)
    page: HTMLResponse = render(
        "error.html", ErrorPage(status=status, title=what, what="", where=where, do=do), status=status
    )
    return page
