"""regen robot: reports, autonomy, stops and postures of the robots of a running console."""

from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from app.acts.missions import LimitAutonomyAct, SetAutonomyAct
from app.acts.robots import OrderPostureAct, SendToSafetyAct, StopRobotAct, StopRobotsAct
from app.cli import output
from app.cli.owner_api import OwnerApi, owner_api
from harness.contracts.control import LEVELS
from harness.contracts.errors import HarnessError
from harness.contracts.reasons import because

HEAD = [
    "robot",
    "worker",
    "link",
    "mode",
    "posture",
    "battery",
    "hardware stop",
    "localised",
    "mission",
    "status",
    "driver",
]
app = typer.Typer(no_args_is_help=True, help="See and stop the robots of a running console.")


@app.command("list")
def list_robots(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Every robot of the site: the process that drives it, link, mode, posture, battery, mission, who drives it."""
    rows = _owner(data).get("/robots")
    output.show({"robots": rows}, as_json=as_json, lines=output.table([HEAD, *map(line_of, rows)]))


@app.command()
def stop(
    robot: str,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    reason: Annotated[str, typer.Option(help="Why; it is stored in the log, and may be left out.")] = "",
) -> None:
    """Stop whatever moves one robot: its mission, a person's hand, its way to safety. Exit 1 if that was refused."""
    _stopped(data, StopRobotAct.of(reason=reason), robot=robot, as_json=as_json)


@app.command("stop-all")
def stop_all(reason: output.Why, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Ask every mission of every robot to stop. Exit 1 if one could not be asked."""
    _stopped(data, StopRobotsAct.of(reason=reason), as_json=as_json)


@app.command()
def safe(
    reason: output.Why,
    robot: Annotated[str, typer.Argument(help="Which; --all instead for every robot.")] = "",
    every: Annotated[bool, typer.Option("--all", help="Stop and send every robot, each for itself.")] = False,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Stop what a robot does and send it to the safe place of its zone; without one it lies down where it stands.

    With --all: every mission stops, all manual control is released, every robot is sent. Exit 1 if one could not be.
    """
    if every == bool(robot):
        raise typer.BadParameter("Name one robot, or --all for every one.")
    if every:
        _stopped(data, StopRobotsAct.of(reason=reason, safe=True), as_json=as_json)
    _show(_owner(data).post(f"/robots/{robot}/safe", SendToSafetyAct.of(reason=reason).body()), as_json=as_json)


@app.command()
def stand(
    robot: str, reason: output.Why, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Have a robot stand up again."""
    act = OrderPostureAct.of(posture="standing", reason=reason)
    _show(_owner(data).post(f"/robots/{robot}/posture", act.body()), as_json=as_json)


@app.command()
def autonomy(
    level: Annotated[str, typer.Argument(help=f"One of {', '.join(LEVELS)}.")],
    reason: output.Why,
    mission: Annotated[str, typer.Option(help="One mission; without it the limit of the whole fleet.")] = "",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Set how far missions decide alone, from their next dispatch on."""
    if level not in LEVELS:
        raise typer.BadParameter(f"{level!r} is not one of {', '.join(LEVELS)}")
    act = (SetAutonomyAct if mission else LimitAutonomyAct).of(autonomy=level, reason=reason)
    path = f"/missions/{mission}/autonomy" if mission else "/control/autonomy"
    outcome = _owner(data).post(path, act.body())
    bound = mission or "every mission"
    output.show(outcome, as_json=as_json, lines=[f"{bound}: {outcome['autonomy']}"])


def _stopped(data: Path, act: StopRobotAct | StopRobotsAct, *, as_json: bool, robot: str = "") -> NoReturn:
    """A stop of one robot or of all, sent to safety too if the act says so; how it went, and how they are then."""
    api = _owner(data)
    outcome = api.post(f"/robots/{robot}/stop" if robot else "/robots/stop", act.body())
    lines = [f"asked to stop: {one}" for one in outcome["asked"]] + [f"not done: {one}" for one in outcome["refused"]]
    rows = [line_of(row) for row in ([api.get(f"/robots/{robot}")] if robot else api.get("/robots"))]
    output.show(outcome, as_json=as_json, lines=(lines or ["No mission was under way."]) + output.table([HEAD, *rows]))
    raise typer.Exit(1 if outcome["refused"] else 0)


def _show(row: dict[str, Any], *, as_json: bool) -> None:
    output.show(row, as_json=as_json, lines=output.table([line_of(row)]))


def line_of(row: dict[str, Any]) -> list[str]:
    status = row["status"]
    cells = (
        [
            status["posture"],
            f"{100 * status['charge']:.0f} %",
            "engaged" if status["hardware_stop"] else "released",
            "yes" if status["localised"] else "no",
        ]
        if status
        else ["unknown"] * 4
    )
    age_s = row["link_age_s"]
    link = "never" if age_s is None else f"{age_s:.1f} s"
    first = [row["robot_id"], row["worker"] or "-", link, row["mode"].replace("_", "-")]
    return [*first, *cells, *(row[name] or "-" for name in ("mission_id", "mission_status", "driver"))]


def _owner(data: Path) -> OwnerApi:
    """Raises HarnessError where no console runs on this folder: without one no robot is under anybody's control."""
    api = owner_api(data)
    if api is None:
        raise HarnessError(because("no_console"), where=str(data))
    return api
