"""Answers failures: a page for people, a problem document (RFC 9457) for programs."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from msgspec import to_builtins
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, Response
from starlette.types import Scope

from app.auth.next_url import OVERVIEW, safe_next_url
from app.auth.permissions import NotPermitted
from app.background.signals import WRITES
from app.i18n import languages
from app.i18n.catalogues import ENGLISH, N_
from app.i18n.reasons import rendering as reasons
from app.views.readings import question_json
from app.web.rendering import render
from harness.contracts import errors
from harness.contracts.reasons import Reason

STATUS: tuple[tuple[type[errors.HarnessError], int], ...] = (
    (NotPermitted, 403),
    (errors.UnknownName, 404),
    (errors.OnlyObserved, 409),
    (errors.ContractInvalid, 422),
    (errors.CloudInvalid, 422),
    (errors.RecordingInvalid, 422),
    (errors.ConcurrencyConflict, 409),
    (errors.BlobGone, 410),
    (errors.BlobDamaged, 404),
    (errors.ProviderFailed, 502),
    (errors.StoreUnavailable, 503),
    (errors.LogDamaged, 500),
)


STORE_AGAIN_S = 5
"""What a caller is told to wait where a store cannot be used."""


class PortBusy(errors.HarnessError):
    """The console cannot listen on its port."""

    code = "port_busy"


@dataclass(frozen=True)
class ErrorPage:
    """What happened, where, and what to do now. `on` is the page that the link leads to: the overview or signing in."""

    status: int
    title: str
    what: str
    where: str
    do: str
    on: str = OVERVIEW


REFUSALS = {
    "signed_out": (
        N_("You are not signed in"),
        N_("This console answers only to people who were let in."),
        N_(
            "Sign in with your account. Before there are accounts: open the one-time link that `regen up` printed; "
            "`regen account link` prints a new one."
        ),
    ),
    "cross_site": (
        N_("This request came from another page"),
        N_("A command counts only if it comes from the console's own pages."),
        N_("Open the console itself and try again there."),
    ),
    "unknown_host": (
        N_("This console does not answer to that name"),
        N_("It answers only to the names it was started with."),
        N_("Open it by the address that `regen up` printed."),
    ),
    "not_permitted": (
        N_("Your role does not allow that"),
        N_("You may look at everything here, and change nothing."),
        N_("Ask an admin of this console for the role you need."),
    ),
    "unreadable": (
        N_("This token does not open that"),
        N_("It was made without the scope read."),
        N_("Use a token that has it."),
    ),
    "too_large": (
        N_("That is too much at once"),
        N_("A request to this console has at most one mebibyte."),
        N_("Send less, or refer to evidence by its digest."),
    ),
    "too_many": (
        N_("Too many requests"),
        N_("This caller asks faster than anybody is served here."),
        N_("Wait, then go on."),
    ),
    "too_many_streams": (
        N_("Too many live views at once"),
        N_("Each person, and each token, holds a limited number of live pages and 3D views here."),
        N_("Close some of them, then open this one again."),
    ),
    "bad_key": (
        N_("This is no idempotency key"),
        N_("An Idempotency-Key has 1 to 200 ASCII characters and no space."),
        N_("Send another key."),
    ),
    "key_reused": (
        N_("This idempotency key belongs to another request"),
        N_("The first request with this key was not the same as this one. Nothing was done."),
        N_("Use a fresh key for another request."),
    ),
    "under_way": (
        N_("The first request with this key is under way"),
        N_("It is not done a second time."),
        N_("Ask again with the same key."),
    ),
    "outcome_unknown": (
        N_("The first request with this key has no answer"),
        N_("The console stopped while it was under way. It is not done a second time."),
        N_("Look at what there is now, then decide with a fresh key."),
    ),
    "shown_once": (
        N_("This was done, and its answer is shown only once"),
        N_("The answer carried a secret that is kept nowhere."),
        N_("Revoke what was made and make another with a fresh key."),
    ),
    "store_unavailable": (
        N_("The accounts cannot be read or written now"),
        N_("Another process holds their database, or its disk fails. Nothing was done."),
        N_("Try again in a few seconds; the same request under the same key is done once."),
    ),
    "unexpected": (
        N_("The console failed to answer"),
        N_("Nothing that was recorded is lost, and missions go on without this page."),
        N_("Try again. If it stays, whoever runs this console finds the cause in its log."),
    ),
    "not_allowed": (
        N_("This address takes no commands"),
        N_("Only reading is possible here."),
        N_("Go back to the overview."),
    ),
}


def problem(
    status: int, *, code: str, title: str, detail: str, do: str = "", more: Mapping[str, Any] | None = None
) -> Response:
    """One problem document; `code` is the slug for machines, `do` is said to people, `more` is added as it is."""
    body = {"type": f"urn:regen:{code}", "title": title, "status": status, "detail": detail, "code": code, "do": do}
    body |= more or {}
    return Response(json.dumps(body), status_code=status, media_type="application/problem+json")


def refused(scope: Scope, *, status: int, code: str, wait_s: float = 0.0) -> Response:
    """A refusal of the middleware in the caller's language; `wait_s` becomes Retry-After."""
    title, what, do = REFUSALS[code]
    if str(scope["path"]).startswith("/api/"):
        answer = problem(status, code=code, title=title, detail=what, do=do)
    else:
        on = _sign_in(scope) if status == 401 else OVERVIEW
        page = ErrorPage(status=status, title=title, what=what, where="", do=do, on=on)
        answer = render("error.html", page, status=status)
    if wait_s:
        answer.headers["retry-after"] = str(ceil(wait_s))
    if status == 401:
        answer.headers["www-authenticate"] = 'Bearer realm="regen"'
    return answer


def _sign_in(scope: Scope) -> str:
    """The sign-in page, which leads back to the page that was asked for."""
    query = scope["query_string"].decode("latin-1")
    page = safe_next_url(f"{scope['path']}{'?' if query else ''}{query}") if scope["method"] == "GET" else OVERVIEW
    return "/account/sign-in" if page == OVERVIEW else f"/account/sign-in?page={quote(page, safe='')}"


def install(app: FastAPI) -> None:
    """Install the handlers that turn every failure of a route into a page or a problem document."""

    @app.exception_handler(errors.HarnessError)
    def harness_error(request: Request, error: errors.HarnessError) -> Response:
        status = next((number for kind, number in STATUS if isinstance(error, kind)), 500)
        language = ENGLISH if _for_programs(request) else languages.CHOICE.get().language
        what, do = reasons.sentence(error.what, language), reasons.remedy(error, language)
        where = reasons.sentence(error.where, language)
        more = {"reason": to_builtins(error.what)} if isinstance(error.what, Reason) else {}
        if isinstance(error, errors.GoalNotUnderstood):
            more |= question_json(error.question)
        writes = WRITES.get()
        if writes is not None and isinstance(error, errors.StoreBusy):
            writes.busy = True
        answer = answered(request, status=status, code=error.code, what=what, where=where, do=do, more=more)
        if isinstance(error, errors.StoreUnavailable):
            answer.headers["retry-after"] = str(STORE_AGAIN_S)
        return answer

    @app.exception_handler(RequestValidationError)
    def invalid(request: Request, error: RequestValidationError) -> Response:
        wrong = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors())
        return answered(
            request, status=422, code="invalid", what=N_("The request is not well formed"), where=wrong, do=""
        )

    @app.exception_handler(HTTPException)
    def http(request: Request, error: HTTPException) -> Response:
        what = N_("There is no such page") if error.status_code == 404 else str(error.detail)
        return answered(request, status=error.status_code, code="http", what=what, where=request.url.path, do="")


def answered(
    request: Request,
    *,
    status: int,
    code: str,
    what: str,
    where: str,
    do: str,
    more: Mapping[str, Any] | None = None,
) -> Response:
    """One failure as a problem for /api/, to which `more` is added, else as a page."""
    if _for_programs(request):
        return problem(status, code=code, title=what, detail=f"{what}. {where}".strip(), do=do, more=more)
    page: HTMLResponse = render(
        "error.html", ErrorPage(status=status, title=what, what="", where=where, do=do), status=status
    )
    return page


def _for_programs(request: Request) -> bool:
    """Programs are answered in English."""
    return request.url.path.startswith("/api/")
