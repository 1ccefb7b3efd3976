"""regen mission dossier: a mission as one signed file, with its report for people."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.cli import output
from app.cli.logins import acting_name
from app.web.dossier_export import export_with_report
from harness.bootstrap import read_harness
from harness.contracts.ids import MissionId


def dossier(
    mission_id: Annotated[str, typer.Argument(help="The mission.")],
    out: Annotated[Path | None, typer.Option("--out", help="The file; MISSION.dossier.zip if left out.")] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Write events, verdicts, decisions, contexts, evidence and report of a mission as one signed file."""
    file = out or Path(f"{mission_id}.dossier.zip")
    with read_harness(output.settings(data_folder=data)) as runtime:
        contents = export_with_report(runtime, MissionId(mission_id), file, data=data, exported_by=acting_name(data))
    blobs = sum(name.startswith("blobs/") for name in contents.files)
    lines = [f"{file}: {contents.events} events, {contents.records} records, {blobs} blobs, report.pdf."]
    lines += [f"Evidence {digest} was missing or damaged and is not in it." for digest in contents.absent]
    lines += [f"Evidence {digest} was erased; its tombstone is in it." for digest in contents.erased or ()]
    output.show({"file": str(file), **msgspec.to_builtins(contents)}, as_json=as_json, lines=lines)
