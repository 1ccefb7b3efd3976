"""/api/v1/alerts: the inbox, and acknowledge, shelve, suppress, restore and assign."""

from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.responses import JSONResponse

from app.acts import alerts as acts
from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.routes.alerts import history_of, told
from app.views import alerts
from app.views.alerts import AlertListParams, AlertRow
from harness.contracts.alert_commands import AlertPersonCommand
from harness.contracts.decisions import Refused
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because

router = APIRouter(
    prefix="/api/v1",
    default_response_class=JSONResponse,
    responses=api_requests.PROBLEMS,
    dependencies=api_requests.CHECKED,
    tags=["alerts"],
)


@router.get("/alerts", responses=api_requests.answers(schemas.AlertSummary, many=True))
def listed(
    console: ConsoleDep,
    q: api_requests.Words = "",
    status: api_requests.Facet = "all",
    priority: api_requests.Facet = "",
    robot: api_requests.Facet = "",
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> Any:
    """What happened last first. `status` is a tab of the page: empty for what nobody acknowledged, all, active, ..."""
    if status not in {value for value, _, _ in alerts.GROUPS}:
        raise UnknownName(because("unknown_alert_status", status=status[:40]))
    asked = AlertListParams(group=status, words=q, priority=priority, robot=robot)
    found = alerts.chosen(console.alerts.all(), asked, now_s=console.clock())[:limit]
    return api_requests.plain([schemas.AlertSummary(**_summary(one)) for one in found])


@router.get("/alerts/{alert_id}", responses=api_requests.answers(schemas.AlertResource))
def show(console: ConsoleDep, alert_id: str) -> Any:
    """One alert with its history."""
    return _shown(console, alert_id)


@router.post("/alerts/{alert_id}/acknowledge", responses=api_requests.answers(schemas.AlertResource))
def acknowledge(console: ConsoleDep, actor: ActorDep, alert_id: str, body: acts.AcknowledgeAlertAct) -> Any:
    """A person has seen it."""
    return _said(console, alert_id, body.to_command(actor))


@router.post("/alerts/{alert_id}/shelve", responses=api_requests.answers(schemas.AlertResource))
def shelve(console: ConsoleDep, actor: ActorDep, alert_id: str, body: acts.ShelveAlertAct) -> Any:
    """Out of the way for a while; it comes back by itself."""
    return _said(console, alert_id, body.to_command(actor))


@router.post("/alerts/{alert_id}/suppress", responses=api_requests.answers(schemas.AlertResource))
def suppress(console: ConsoleDep, actor: ActorDep, alert_id: str, body: acts.SuppressAlertAct) -> Any:
    """Out of the way until somebody restores it."""
    return _said(console, alert_id, body.to_command(actor))


@router.post("/alerts/{alert_id}/restore", responses=api_requests.answers(schemas.AlertResource))
def restore(console: ConsoleDep, actor: ActorDep, alert_id: str, body: acts.RestoreAlertAct) -> Any:
    """Unshelve or unsuppress an alert."""
    return _said(console, alert_id, body.to_command(actor))


@router.post("/alerts/{alert_id}/assign", responses=api_requests.answers(schemas.AlertResource))
def assign(console: ConsoleDep, actor: ActorDep, alert_id: str, body: acts.AssignAlertAct) -> Any:
    """Somebody is to look after it."""
    return _said(console, alert_id, body.to_command(actor))


def _said(console: Console, alert_id: str, command: AlertPersonCommand) -> Any:
    decision = told(console, alert_id, command)
    return api_requests.refusal(decision) if isinstance(decision, Refused) else _shown(console, alert_id)


def _shown(console: Console, alert_id: str) -> Any:
    alert = console.alerts.one(alert_id)
    summary = _summary(alerts.row(alert_id, alert, now_s=console.clock()))
    history = tuple(
        schemas.AlertLine(at_s=one.at_s, text=one.text, position=one.position) for one in history_of(console, alert_id)
    )
    return api_requests.plain(schemas.AlertResource(**summary, conditions=tuple(alert.standing), history=history))


def _summary(one: AlertRow) -> dict[str, Any]:
    """What both shapes of an alert share."""
    same = (name for name in schemas.AlertSummary.__struct_fields__ if name != "shelved_until_s")
    return {**{name: getattr(one, name) for name in same}, "shelved_until_s": one.until_s or None}
