"""How the editors of places, routes, missions and robots answer a posted form."""

from collections.abc import Callable, Sequence
from typing import Any

from starlette.responses import RedirectResponse, Response

from app.i18n.messages import reasoned
from app.views.forms import Wrong
from app.web.rendering import render
from harness.contracts.any_events import AnyEvent
from harness.contracts.decisions import Accepted, Refused

FormPage = Callable[[Sequence[Wrong]], Any]
"""The page of a form as it was left, with what is wrong with it."""


def left(template: str, page: FormPage, wrong: Sequence[Wrong]) -> Response:
    """The form as it was left: nothing was saved."""
    return render(template, page(wrong), status=422)


def answered(template: str, page: FormPage, decision: Accepted[AnyEvent] | Refused, *, then: str) -> Response:
    """On to `then`; where the gate refused, the form as it was left, with why."""
    if isinstance(decision, Refused):
        return render(template, page([Wrong("", reasoned(decision.reason))]), status=409)
    return RedirectResponse(then, status_code=303)
