"""regen alert: what a person should know, and acknowledge, shelve, suppress, restore, assign."""

from pathlib import Path
from typing import Annotated, Any

import typer

from app.alerts import Alerts
from app.terminal.answers import DEFAULT_DATA, Data, Json, settings, show, table
from app.terminal.missions import me
from app.terminal.owner import owner_api
from app.views import alerts
from app.views.alerts import AlertRow
from app.views.saying import reasoned
from harness.adapters.clock import SystemClock
from harness.bootstrap import edit_harness, read_harness
from harness.contracts.alert_commands import (
    AcknowledgeAlert,
    AlertPersonCommand,
    AssignAlert,
    RestoreAlert,
    ShelveAlert,
    SuppressAlert,
)
from harness.contracts.alert_events import alert_stream
from harness.contracts.decisions import Refused
from harness.contracts.errors import HarnessError
from harness.runtime import Runtime

app = typer.Typer(no_args_is_help=True, help="See what went wrong, one row per cause, and look after it.")
Reason = Annotated[str, typer.Option(help="Why; it stands in the log.")]
AlertArgument = Annotated[str, typer.Argument(help="As `regen alert list` names it.")]


@app.command("list")
def list_alerts(
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    everything: Annotated[bool, typer.Option("--all", help="What is over or put away too.")] = False,
) -> None:
    """What happened last first; without --all only what nobody acknowledged."""
    api = owner_api(data)
    if api is not None:
        rows: list[dict[str, Any]] = api.get(f"/alerts?status={'all' if everything else ''}")
    else:
        with read_harness(settings(data_folder=data)) as runtime:
            rows = [
                vars(one)
                for name, alert in Alerts(runtime).all()
                if (one := alerts.row(name, alert, now_s=SystemClock().now().wall_s))
                and (everything or one.state in ("unacknowledged", "returned"))
            ]
    lines = table(
        [["alert", "priority", "state", "times", "what"]]
        + [[r["alert_id"], r["priority"], r["state"], str(r["count"]), r["title"]] for r in rows]
    )
    show({"alerts": rows}, as_json=as_json, lines=lines if rows else ["Nothing needs to be looked at."])


@app.command()
def ack(
    alert_id: AlertArgument,
    note: Annotated[str, typer.Option(help="What was found.")] = "",
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
) -> None:
    """Say that you have seen it."""
    seen = int(_one(data, alert_id)["total"])
    command = AcknowledgeAlert(actor=me(), seen=seen, note=note)
    _say(data, alert_id, ("acknowledge", {"seen": seen, "note": note}), command, as_json=as_json)


@app.command()
def shelve(
    alert_id: AlertArgument,
    reason: Reason,
    minutes: Annotated[float, typer.Option(help="For how long, at most 1440.", min=0.1, max=1440)] = 60.0,
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
) -> None:
    """Put it out of the way for a while; it comes back by itself."""
    command = ShelveAlert(actor=me(), reason=reason, for_s=minutes * 60)
    _say(data, alert_id, ("shelve", {"reason": reason, "for_s": minutes * 60}), command, as_json=as_json)


@app.command()
def suppress(alert_id: AlertArgument, reason: Reason, data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Put it out of the way until somebody restores it."""
    command = SuppressAlert(actor=me(), reason=reason)
    _say(data, alert_id, ("suppress", {"reason": reason}), command, as_json=as_json)


@app.command()
def restore(alert_id: AlertArgument, data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Bring it back from the shelf or from suppression."""
    _say(data, alert_id, ("restore", {}), RestoreAlert(actor=me()), as_json=as_json)


@app.command()
def assign(
    alert_id: AlertArgument,
    to: Annotated[str, typer.Option(help="Who looks after it; empty takes it back.")],
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
) -> None:
    """Say who looks after it."""
    command = AssignAlert(actor=me(), assignee=to)
    _say(data, alert_id, ("assign", {"assignee": to}), command, as_json=as_json)


def _one(data: Path, alert_id: str) -> dict[str, Any]:
    """Raises UnknownName."""
    api = owner_api(data)
    if api is not None:
        found: dict[str, Any] = api.get(f"/alerts/{alert_id}")
        return found
    with read_harness(settings(data_folder=data)) as runtime:
        return vars(_row(runtime, alert_id))


def _row(runtime: Runtime, alert_id: str) -> AlertRow:
    return alerts.row(alert_id, Alerts(runtime).one(alert_id), now_s=SystemClock().now().wall_s)


def _say(
    data: Path, alert_id: str, word: tuple[str, dict[str, Any]], command: AlertPersonCommand, *, as_json: bool
) -> None:
    """By the owner's API, or as the folder's one owner. Raises UnknownName, and HarnessError where it is refused."""
    api = owner_api(data)
    if api is not None:
        found: dict[str, Any] = api.post(f"/alerts/{alert_id}/{word[0]}", word[1])
    else:
        with edit_harness(settings(data_folder=data)) as runtime:
            Alerts(runtime).one(alert_id)
            decision = runtime.decide([(alert_stream(alert_id), command)])
            if isinstance(decision, Refused):
                raise HarnessError(reasoned(decision.message), where=alert_id, do="see `regen alert list --all`")
            found = vars(_row(runtime, alert_id))
    show(found, as_json=as_json, lines=[f"{alert_id} is {found['state']}: {found['title']}"])
