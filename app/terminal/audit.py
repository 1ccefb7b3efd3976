"""regen audit: verify the log's hash chain, replay a mission from its events, export the head."""

from typing import Any

import typer

from app.terminal.answers import DEFAULT_DATA, Data, Json, settings, show
from harness.auditing import replay_mission
from harness.bootstrap import read_harness
from harness.contracts.ids import MissionId

app = typer.Typer(no_args_is_help=True, help="Reconstruct and check what happened.")


@app.command()
def verify(data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Recompute every hash of the log and of its records."""
    with read_harness(settings(data_folder=data)) as runtime:
        head = runtime.verify()
    found: dict[str, Any] = {"ok": True, "position": head.position, "digest": head.digest}
    show(found, as_json=as_json, lines=[f"The log is intact: {head.position} events, head {head.digest}."])


@app.command()
def anchor(data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """The head of the log, to be kept elsewhere: the log is tamper-evident up to the last anchor."""
    with read_harness(settings(data_folder=data)) as runtime:
        head = runtime.head()
    show({"position": head.position, "digest": head.digest}, as_json=as_json, lines=[f"{head.position} {head.digest}"])


@app.command()
def replay(mission_id: str, data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Fold the mission again and derive its verdicts and gate decisions again; report every difference."""
    with read_harness(settings(data_folder=data)) as runtime:
        report = replay_mission(runtime, MissionId(mission_id))
    lines = [
        f"{report.events} events, {report.verdicts} verdicts and {report.decisions} gate decisions derived again, "
        f"state version {report.k}, state {report.state[:16]}",
        *report.differences,
    ]
    found = {
        "mission_id": mission_id,
        "events": report.events,
        "verdicts": report.verdicts,
        "decisions": report.decisions,
        "state_version": report.k,
        "state": report.state,
        "differences": list(report.differences),
    }
    show(found, as_json=as_json, lines=lines)
    raise typer.Exit(1 if report.differences else 0)
