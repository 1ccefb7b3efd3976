"""/alerts: what needs a person's attention, one row per cause, and what people do about it."""

from collections.abc import Callable
from math import isfinite
from typing import Annotated

from fastapi import APIRouter, Depends, Query
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.alerts import ACTS
from app.acts.base import Act
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.messages import reasoned
from app.views import alerts
from app.views.alerts import AlertListParams, AlertPage, AlertsPage
from app.views.history import HistoryLine
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.alert_commands import AlertPersonCommand
from harness.contracts.alert_events import AlertEvent, alert_stream
from harness.contracts.any_events import AnyEvent
from harness.contracts.decider import Codec
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because

router = APIRouter(prefix="/alerts")
LONGEST = 200
EVENTS: Codec[AlertEvent] = Codec(AlertEvent)
Words = Annotated[str, Query(max_length=LONGEST)]


def list_params(
    q: Words = "", status: Words = "", priority: Words = "", robot: Words = "", before: float | None = None
) -> AlertListParams:
    """What the address asks for. Raises UnknownName for a tab that the inbox does not have."""
    if status not in {value for value, _, _ in alerts.GROUPS}:
        raise UnknownName(because("unknown_alert_tab", status=status[:40]))
    place = before if before is not None and isfinite(before) else None
    return AlertListParams(group=status, words=q.strip(), priority=priority, robot=robot, before_s=place)


AskedDep = Annotated[AlertListParams, Depends(list_params)]


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, params: AskedDep) -> HTMLResponse:
    return render("alerts/index.html", listed(console, actor, params))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep, params: AskedDep) -> HTMLResponse:
    return render("alerts/_list.html", listed(console, actor, params))


def listed(console: Console, actor: Actor, params: AlertListParams) -> AlertsPage:
    shell = console.shell("Alerts", "alerts", actor)
    return alerts.alerts_page(
        shell, console.alerts.all(), params, now_s=console.clock(), services=console.settings.services
    )


@router.get("/{alert_id}")
def show(console: ConsoleDep, actor: ActorDep, alert_id: str) -> HTMLResponse:
    return render("alerts/detail.html", page_of(console, actor, alert_id))


def _route(kind: type[Act]) -> Callable[..., Response]:
    """The handler of one act of app/acts/alerts.py: 303, 422 for invalid input, 409 with the reason of a refusal."""

    def act(console: ConsoleDep, actor: ActorDep, alert_id: str, typed: FormDep) -> Response:
        submitted = kind.from_form(typed)
        if isinstance(submitted, tuple):
            return _again(console, actor, alert_id, tuple(one.text for one in submitted), status=422)
        decision = decided(console, alert_id, submitted.to_command(actor))
        if isinstance(decision, Refused):
            return _again(console, actor, alert_id, (reasoned(decision.reason),), status=409)
        return RedirectResponse(f"/alerts/{alert_id}", status_code=303)

    return act


for word, kind in ACTS.items():
    router.post(f"/{{alert_id}}/{word}", name=word)(_route(kind))


def decided(console: Console, alert_id: str, command: AlertPersonCommand) -> Accepted[AnyEvent] | Refused:
    """Raises UnknownName for an alert that was never raised."""
    console.alerts.one(alert_id)
    return console.runtime.decide([(alert_stream(alert_id), command)])


def history_of(console: Console, alert_id: str) -> tuple[HistoryLine, ...]:
    """Everything that happened to it, newest first."""
    stored = console.runtime.stream(alert_stream(alert_id))
    return tuple(
        HistoryLine(at_s=one.recorded_s, text=alerts.sentence(EVENTS.decode(one)), position=one.position)
        for one in reversed(stored)
    )


def page_of(console: Console, actor: Actor, alert_id: str, errors: tuple[str, ...] = ()) -> AlertPage:
    alert = console.alerts.one(alert_id)
    row = alerts.item(alert_id, alert, now_s=console.clock())
    return AlertPage(
        shell=console.shell(alerts.title(row), "alerts", actor),
        row=row,
        conditions=tuple(map(alerts.lasting, alert.standing)),
        history=history_of(console, alert_id),
        shelves=alerts.shelves(),
        errors=errors,
    )


def _again(console: Console, actor: Actor, alert_id: str, wrong: tuple[str, ...], *, status: int) -> HTMLResponse:
    return render("alerts/detail.html", page_of(console, actor, alert_id, wrong), status=status)
