"""regen audit bags: how many declared successes of a team's recordings lack evidence, and of which kind."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli import output
from app.i18n.reasons.rendering import sentence
from app.i18n.visible_text import visible_at_terminal
from app.views.bag_audits import KINDS, VERDICTS, audit_json, counted
from harness.adapters.providers.recording.topics import topic_settings
from harness.adapters.stores.folder import prepare
from harness.contracts.declared_successes import AuditedRecording, BagAudit
from harness.recording_audits import ARRIVAL, audited_folder


def bags(
    folder: Annotated[Path, typer.Argument(help="A folder with recordings, in it and below it.")],
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    topic: Annotated[
        list[str] | None, typer.Option(help="ROLE=TOPIC, or arrival=REGEX for how your supervisor says it.")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Also read recordings whose results are here.")] = False,
) -> None:
    """Read recordings one by one; judge every success that they declare by their own samples.

    Nothing is written but the results, in the data folder. An audit that was ended goes on where it was. Exit 1 if a
    recording could not be read.
    """
    prepare(data)
    audit = audited_folder(
        folder, data, topics=topic_settings(topic or (), arrival=ARRIVAL), again=again, watch=_progress
    )
    output.show(audit_json(audit), as_json=as_json, lines=_lines(audit))
    raise typer.Exit(1 if audit.unreadable else 0)


def _progress(one: AuditedRecording, number: int, total: int) -> None:
    what = f"{len(one.successes)} declared successes" if one.problem is None else "not readable"
    sys.stderr.write(visible_at_terminal(f"{number}/{total}  {one.path}: {what}\n"))


def _lines(audit: BagAudit) -> list[str]:
    counts = counted(audit)
    lines = [
        f"{counts.recordings} recordings, {counts.unreadable} not readable, {counts.incomplete} cut off; "
        f"{counts.successes} declared successes."
    ]
    if counts.successes:
        lines += output.table([[VERDICTS[verdict], str(number)] for verdict, number in counts.verdicts.items()])
        lines += ["Successes that lack"]
        lines += output.table([[f"  {KINDS[lack]}", str(number)] for lack, number in counts.lacks.items()])
    rows = [
        [one.path, finding.success.name or "-", VERDICTS[finding.verdict], _metres(finding.success.declared_distance_m),
         _metres(finding.distance_m), ", ".join(finding.lacks) or "-"]
        for one in audit.recordings
        for finding in one.successes
    ]  # fmt: skip
    if rows:
        lines += output.table([["recording", "leg", "verdict", "declared m", "measured m", "lacks"], *rows])
    return lines + [f"{one.path}: {sentence(one.problem)}" for one in audit.unreadable if one.problem is not None]


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
