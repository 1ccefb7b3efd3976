"""regen audit: verify the log, its snapshots and its anchors, replay a mission, and export the head of the log."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.cli import output
from app.i18n.reasons.rendering import sentence, stating
from harness.anchors import anchor_line, append_line, compared_with_file, taken_anchor
from harness.auditing.replay import ReplayReport, replay_all, replay_mission
from harness.bootstrap import read_harness
from harness.contracts.anchors import AnchorFinding
from harness.contracts.ids import MissionId
from harness.contracts.ports import SnapshotFindings
from harness.contracts.reasons import because
from rsi_reviews.deciders import DECIDERS

RECONSTRUCTED = "commands reconstructed from events (log from before commands were stored)"
app = typer.Typer(no_args_is_help=True, help="Reconstruct and check what happened.")


@app.command()
def verify(
    data: output.Data = output.DEFAULT_DATA,
    anchor: Annotated[
        Path | None, typer.Option("--anchor", help="A file of anchors to compare the log with; else REGEN_ANCHOR_FILE.")
    ] = None,
    anchor_key: Annotated[
        str, typer.Option("--anchor-key", help="The public key that must have signed them, in hexadecimal.")
    ] = "",
    as_json: output.Json = False,
) -> None:
    """Recompute every hash of the log and of its records, check its snapshots, and compare it with its anchors.

    Exit 1 if a hash, a snapshot or an anchor does not fit.
    """
    settings = output.settings(data_folder=data)
    with read_harness(settings, deciders=DECIDERS) as runtime:
        head = runtime.verify()
        snapshots = runtime.audit_snapshots()
        file = anchor or settings.anchor_file
        anchors = compared_with_file(runtime, file, key=anchor_key) if file is not None else ()
    problems = log_problems(snapshots, anchors)
    found = {
        "ok": not problems,
        "position": head.position,
        "digest": head.digest,
        "snapshots": stating(snapshots),
        "anchors": stating(anchors),
        "problems": problems,
    }
    lines = [f"The chain is intact: {head.position} events, head {head.digest}.", *snapshot_lines(snapshots)]
    lines += [_anchor_line(one) for one in anchors if one.reason is None]
    output.show(found, as_json=as_json, lines=[*lines, *problems])
    raise typer.Exit(1 if problems else 0)


@app.command()
def anchor(
    data: output.Data = output.DEFAULT_DATA,
    out: Annotated[Path | None, typer.Option("--out", help="Add it to this file, too.")] = None,
    key: Annotated[
        Path | None, typer.Option("--key", help="Sign it with this Ed25519 private key (PEM, or its 32 bytes).")
    ] = None,
    as_json: output.Json = False,
) -> None:
    """The head of the log, to be kept elsewhere: the log is tamper-evident up to the last anchor."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        taken = taken_anchor(runtime, key_file=key)
    if out is not None:
        append_line(taken, out)
    output.show(msgspec.to_builtins(taken), as_json=as_json, lines=[anchor_line(taken)])


def log_problems(snapshots: SnapshotFindings, anchors: Sequence[AnchorFinding]) -> list[str]:
    """What does not fit, as sentences: forged snapshots, and anchors that the log contradicts."""
    forged = [sentence(because("snapshot_forged", stream=stream)) for stream in snapshots.forged]
    return [*forged, *(sentence(one.reason) for one in anchors if one.reason is not None)]


def snapshot_lines(snapshots: SnapshotFindings) -> list[str]:
    """How many snapshots are used, and why others are not."""
    lines = []
    if snapshots.sealed or snapshots.unsealed:
        lines = [f"{snapshots.sealed} snapshots are sealed by this installation and say what the events say."]
    if snapshots.unsealed:
        lines.append(f"{snapshots.unsealed} snapshots of another release or installation are not used.")
    if snapshots.unkeyed is not None:
        lines.append(f"No snapshot is used: {sentence(snapshots.unkeyed)}.")
    return lines


def _anchor_line(found: AnchorFinding) -> str:
    if found.trusted:
        signer = "signed by the key you named"
    elif found.signed:
        signer = f"signed by {found.public_key}: compare it with the key you were told"
    else:
        signer = "not signed"
    return f"The log holds event {found.position} as the anchor names it ({signer})."


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
    return {**stating(report), "state_version": report.k}


def _lines(report: ReplayReport) -> list[str]:
    derived = (
        f"{report.plans} plans, {report.routings} routings, {report.skills} skills, {report.verdicts} verdicts, "
        f"{report.goals} goal verdicts and {report.recoveries} recovery steps derived again"
    )
    gate = f"{report.decisions + report.leases + report.handoffs} gate decisions made again"
    if report.reconstructed:
        gate += f", {report.reconstructed} of them with {RECONSTRUCTED}"
    if report.erased:
        derived += f", {report.erased} verdicts not: their evidence was erased"
    counted = f"{len(report.differences)} differences" if report.differences else "no difference"
    return [
        f"{report.mission_id}: {report.events} events; {derived}; {gate}; state version {report.k}, "
        f"state {report.state[:16]}; {counted}",
        *map(sentence, report.differences),
    ]
