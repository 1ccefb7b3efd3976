"""/api/v1/alerts: list, acknowledge, shelve, suppress, restore and assign alerts."""

from typing import Annotated, Any

from fastapi import Query

from app.acts.alerts import ACTS
from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.routes.alerts import decided, history_of
from app.views import alerts
from app.views.alerts import AlertListParams
from harness.contracts.decisions import Refused
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because

router = api_requests.router("alerts")


@router.get("/alerts", responses=api_requests.answers(schemas.AlertSummary, many=True))
def listed(
    console: ConsoleDep,
    q: api_requests.Words = "",
    status: api_requests.Facet = "all",
    priority: api_requests.Facet = "",
    robot: api_requests.Facet = "",
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> Any:
    """Alerts, newest occurrence first. `status` is a tab of the page: empty for unacknowledged, all, active, ..."""
    if status not in {value for value, _, _ in alerts.GROUPS}:
        raise UnknownName(because("unknown_alert_status", status=status[:40]))
    params = AlertListParams(group=status, words=q, priority=priority, robot=robot)
    found = alerts.chosen(console.alerts.all(), params, now_s=console.clock())[:limit]
    return api_requests.each(lambda one: schemas.AlertSummary(**alerts.summary(one)), found)


@router.get("/alerts/{alert_id}", responses=api_requests.answers(schemas.AlertResource))
def show(console: ConsoleDep, alert_id: str) -> Any:
    """One alert with its history."""
    return _alert_resource(console, alert_id)


def _act() -> api_requests.Handler:
    def act(console: ConsoleDep, actor: ActorDep, alert_id: str, body: Any) -> Any:
        decision = decided(console, alert_id, body.to_command(actor))
        return api_requests.refusal(decision) if isinstance(decision, Refused) else _alert_resource(console, alert_id)

    return act


api_requests.post_acts(router, "/alerts/{alert_id}", ACTS, _act, answered=schemas.AlertResource)


def _alert_resource(console: Console, alert_id: str) -> Any:
    alert = console.alerts.one(alert_id)
    summary = alerts.summary(alerts.item(alert_id, alert, now_s=console.clock()))
    history = tuple(
        schemas.AlertLine(at_s=one.at_s, text=one.text, position=one.position) for one in history_of(console, alert_id)
    )
    return api_requests.plain(schemas.AlertResource(**summary, conditions=tuple(alert.standing), history=history))
