"""regen alert: list, acknowledge, shelve, suppress, restore and assign alerts."""

from typing import Annotated, Any

import typer

from app.acts import alerts as acts
from app.acts.base import Act
from app.background.alerts import Alerts
from app.cli import output
from app.cli.api import api_without_robots
from app.cli.api_client import Api
from app.cli.owner_api import owner_api
from app.views import alerts
from harness.adapters.clock import SystemClock
from harness.bootstrap import read_harness

app = typer.Typer(no_args_is_help=True, help="See what went wrong, one row per cause, and look after it.")
AlertArgument = Annotated[str, typer.Argument(help="As `regen alert list` names it.")]


@app.command("list")
def list_alerts(
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    everything: Annotated[bool, typer.Option("--all", help="What is over or put away too.")] = False,
) -> None:
    """What happened last first; without --all only what nobody acknowledged."""
    api = owner_api(data)
    if api is not None:
        rows: list[dict[str, Any]] = api.get(f"/alerts?status={'all' if everything else ''}")
    else:
        with read_harness(output.settings(data_folder=data)) as runtime:
            rows = [
                alerts.summary(one)
                for name, alert in Alerts(runtime).all()
                if (one := alerts.item(name, alert, now_s=SystemClock().now().wall_s))
                and (everything or one.state in ("unacknowledged", "returned"))
            ]
    lines = output.table(
        [["alert", "priority", "state", "times", "what"]]
        + [[r["alert_id"], r["priority"], r["state"], str(r["count"]), r["title"]] for r in rows]
    )
    output.show({"alerts": rows}, as_json=as_json, lines=lines if rows else ["Nothing needs to be looked at."])


@app.command()
def ack(
    alert_id: AlertArgument,
    note: Annotated[str, typer.Option(help="What was found.")] = "",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say that you have seen it."""
    with api_without_robots(data) as api:
        seen = api.get(f"/alerts/{alert_id}")["total"]
        _post(api, alert_id, "acknowledge", acts.AcknowledgeAlertAct.of(seen=seen, note=note), as_json=as_json)


@app.command()
def shelve(
    alert_id: AlertArgument,
    reason: output.Why,
    minutes: Annotated[float, typer.Option(help="For how long, at most 1440.", min=0.1, max=1440)] = 60.0,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Put it out of the way for a while; it comes back by itself."""
    with api_without_robots(data) as api:
        _post(api, alert_id, "shelve", acts.ShelveAlertAct.of(reason=reason, for_s=minutes * 60), as_json=as_json)


@app.command()
def suppress(
    alert_id: AlertArgument, reason: output.Why, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Put it out of the way until somebody restores it."""
    with api_without_robots(data) as api:
        _post(api, alert_id, "suppress", acts.SuppressAlertAct.of(reason=reason), as_json=as_json)


@app.command()
def restore(alert_id: AlertArgument, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Unshelve or unsuppress an alert."""
    with api_without_robots(data) as api:
        _post(api, alert_id, "restore", acts.RestoreAlertAct.of(), as_json=as_json)


@app.command()
def assign(
    alert_id: AlertArgument,
    to: Annotated[str, typer.Option(help="Who looks after it; empty takes it back.")],
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say who looks after it."""
    with api_without_robots(data) as api:
        _post(api, alert_id, "assign", acts.AssignAlertAct.of(assignee=to), as_json=as_json)


def _post(api: Api, alert_id: str, word: str, act: Act, *, as_json: bool) -> None:
    """Post the act and print the alert after it. Raises UnknownName, and HarnessError where it is refused."""
    found: dict[str, Any] = api.post(f"/alerts/{alert_id}/{word}", act.body())
    output.show(found, as_json=as_json, lines=[f"{alert_id} is {found['state']}: {found['title']}"])
