"""regen audit: verify the log's hash chain, replay a mission from its events, and export the head of the log."""

from typing import Annotated, Any

import msgspec
import typer

from app.cli import output
from harness.auditing.replay import RECONSTRUCTED, ReplayReport, replay_all, replay_mission
from harness.bootstrap import read_harness
from harness.contracts.ids import MissionId

app = typer.Typer(no_args_is_help=True, help="Reconstruct and check what happened.")


@app.command()
def verify(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Recompute every hash of the log and of its records."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        head = runtime.verify()
    found: dict[str, Any] = {"ok": True, "position": head.position, "digest": head.digest}
    output.show(found, as_json=as_json, lines=[f"The log is intact: {head.position} events, head {head.digest}."])


@app.command()
def anchor(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """The head of the log, to be kept elsewhere: the log is tamper-evident up to the last anchor."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        head = runtime.head()
    output.show(
        {"position": head.position, "digest": head.digest}, as_json=as_json, lines=[f"{head.position} {head.digest}"]
    )


@app.command()
def replay(
    mission_id: Annotated[str, typer.Argument(help="The mission; leave it out with --all.")] = "",
    everything: Annotated[bool, typer.Option("--all", help="Every mission of the log.")] = False,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Fold again, ask every role again what it was shown, decide again; report every difference with its position."""
    if bool(mission_id) == everything:
        raise typer.BadParameter("name one mission, or give --all", param_hint="MISSION_ID")
    with read_harness(output.settings(data_folder=data)) as runtime:
        reports = list(replay_all(runtime)) if everything else [replay_mission(runtime, MissionId(mission_id))]
    rows = [_row(report) for report in reports]
    found = {"missions": rows} if everything else rows[0]
    output.show(found, as_json=as_json, lines=[line for report in reports for line in _lines(report)])
    raise typer.Exit(1 if any(report.differences for report in reports) else 0)


def _row(report: ReplayReport) -> dict[str, Any]:
    return {**msgspec.to_builtins(report), "state_version": report.k}


def _lines(report: ReplayReport) -> list[str]:
    derived = (
        f"{report.plans} plans, {report.routings} routings, {report.skills} skills, {report.verdicts} verdicts, "
        f"{report.goals} goal verdicts and {report.recoveries} recovery steps derived again"
    )
    gate = f"{report.decisions + report.leases + report.handoffs} gate decisions made again"
    if report.reconstructed:
        gate += f", {report.reconstructed} of them with {RECONSTRUCTED}"
    counted = f"{len(report.differences)} differences" if report.differences else "no difference"
    return [
        f"{report.mission_id}: {report.events} events; {derived}; {gate}; state version {report.k}, "
        f"state {report.state[:16]}; {counted}",
        *report.differences,
    ]
