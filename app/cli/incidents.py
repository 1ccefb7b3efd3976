"""regen incident: a recording or a mission becomes a timeline, a signed evidence bundle and a regression case."""

import json
import shutil
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.acts.releases import AddCaseAct
from app.background.mission_history import Histories
from app.cli import output
from app.cli.api import api_without_robots
from app.cli.logins import acting_name
from app.cli.missions import target_point
from app.cli.person import me
from app.i18n.reasons import rendering as reasons
from app.views import sentences
from app.views.timeline import TimelineEntry
from app.web.dossier_export import export_with_report
from harness.bootstrap import read_harness
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import MissionId
from harness.contracts.incidents import CaseCondition, IncidentCase, RecordedDrive
from harness.contracts.reasons import because
from harness.contracts.values import decode, encode
from harness.dossiers import verify_dossier
from harness.projections.mission import Mission
from harness.recordings import replayed
from harness.runtime import Runtime
from rsi_reviews.suite_growth import AddedCase, case_of

CASE, DOSSIER, TIMELINE, RECORDING = "case.json", "dossier.zip", "timeline.json", "recording"


def incident(
    source: Annotated[str, typer.Argument(help="A recording, a mission of this folder, or with --again a bundle.")],
    out: Annotated[Path | None, typer.Option("--out", help="The bundle's folder; incident-MISSION without it.")] = None,
    reason: Annotated[str, typer.Option(help="Why; it is stored in the log with the case.")] = "incident",
    target: Annotated[str | None, typer.Option(help="X,Y in metres: where the recorded drive was to end.")] = None,
    topic: Annotated[list[str] | None, typer.Option(help="ROLE=TOPIC, as for `regen mission replay`.")] = None,
    again: Annotated[bool, typer.Option("--again", help="Run a bundle's case again and compare.")] = False,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Write timeline, signed evidence and a case in one folder.

    A mission that failed or is disputed becomes a case of the regression suite as with `regen rsi case`. The case of a
    recording is the recording with every verdict on it: `--again` judges it anew. Exit 1 where they differ.
    """
    if again:
        _compared(Path(source), data, as_json=as_json)
        return
    path = Path(source)
    drive = _replayed(path, data, target=target, topics=topic or []) if path.exists() else None
    mission_id = MissionId(drive[0] if drive else source)
    with read_harness(output.settings(data_folder=data)) as runtime:
        mission = runtime.mission(mission_id)
        folder = _new_folder(out or Path(f"incident-{mission_id}"))
        timeline = [_entry(one) for one in Histories(runtime).of(mission_id)]
        (folder / TIMELINE).write_text(json.dumps(timeline, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        export_with_report(runtime, mission_id, folder / DOSSIER, data=data, exported_by=acting_name(data))
    if drive:
        _copied(path, folder / RECORDING)
    case = IncidentCase(mission_id=mission_id, recorded=drive[1] if drive else None, judged=judged_in(mission))
    (folder / CASE).write_bytes(msgspec.json.format(encode(case)) + b"\n")
    added = None if drive else _added(mission, data, reason)
    answer = {
        "mission_id": mission_id,
        "status": mission.status,
        "folder": str(folder),
        "events": len(timeline),
        "case": msgspec.to_builtins(added) if isinstance(added, AddedCase) else None,
        "no_case": added if isinstance(added, str) else "",
        "judged": msgspec.to_builtins(case.judged),
    }
    output.show(answer, as_json=as_json, lines=_lines(mission, folder, timeline, added, case))


def judged_in(mission: Mission) -> tuple[CaseCondition, ...]:
    """The newest verdict on each condition of a mission, stages first, with what was measured."""
    found: dict[str, CaseCondition] = {}
    results = [one for node in mission.nodes.values() for verdict in node.verdicts for one in verdict.results]
    results += mission.goal_verdict.results if mission.goal_verdict else ()
    for one in results:
        found[one.condition_id] = CaseCondition(
            condition_id=one.condition_id, verdict=one.verdict, measured=one.measured
        )
    return tuple(found.values())


def _replayed(path: Path, data: Path, *, target: str | None, topics: list[str]) -> tuple[str, RecordedDrive]:
    settings = output.settings(data_folder=data, speed=0.0)
    with replayed(settings, path, target=target_point(target), topics=topics, recover=True) as replayer:
        mission, _ = replayer.run(me(), watch=output.ProgressPrinter())
        drive = RecordedDrive(sha256=replayer.recording.sha256, topics=tuple(topics), target=target or "")
    return mission.mission_id, drive


def _added(mission: Mission, data: Path, reason: str) -> AddedCase | str:
    """The case that a mission became, or why it is none: whoever asks may have no account here."""
    found = case_of(mission)
    if not isinstance(found, AddedCase):
        return reasons.sentence(found.reason)
    try:
        with api_without_robots(data) as api:
            answer = api.post(f"/missions/{mission.mission_id}/case", AddCaseAct.of(reason=reason).body())
    except output.ActRefused as error:
        return reasons.explained(error)
    return msgspec.convert(answer["case"], AddedCase)


def _entry(entry: TimelineEntry) -> dict[str, Any]:
    return {
        "position": entry.position,
        "kind": entry.kind,
        "mission_s": entry.mission_s,
        "recorded_s": entry.recorded_s,
        "text": str(sentences.sentence(entry.event)),
    }


def _new_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise ContractInvalid(
            because("incident_folder_unusable", error=error.strerror or str(error)), where=str(folder)
        ) from error
    return folder


def _copied(path: Path, into: Path) -> None:
    if path.is_dir():
        shutil.copytree(path, into)
    else:
        shutil.copyfile(path, into)


def _lines(
    mission: Mission, folder: Path, timeline: list[dict[str, Any]], added: AddedCase | str | None, case: IncidentCase
) -> list[str]:
    first_s = timeline[0]["mission_s"]
    moments = [f"{one['mission_s'] - first_s:>9.2f} s  {one['text']}" for one in timeline]
    lines = [*moments, f"{mission.mission_id}  {mission.status}"]
    lines += output.table([[one.condition_id, one.verdict] for one in case.judged])
    match added:
        case None:
            lines.append(f"`regen incident {folder} --again` judges the recording anew and compares.")
        case str():
            lines.append(f"Not a case of the regression suite: {added}.")
        case AddedCase():
            lines.append(f"It is a case of family {added.family}: {added.template}, seed {added.seed}.")
    return [*lines, f"{folder}: {TIMELINE}, {DOSSIER}, {CASE}."]


def _compared(folder: Path, data: Path, *, as_json: bool) -> None:
    try:
        case = decode((folder / CASE).read_bytes(), IncidentCase)
    except (OSError, msgspec.MsgspecError) as error:
        raise UnknownName(because("incident_bundle_unreadable", error=str(error)), where=str(folder)) from error
    if case.recorded is None:
        differences = [reasons.sentence(one) for one in verify_dossier(folder / DOSSIER).differences]
    else:
        mission_id, drive = _replayed(
            folder / RECORDING, data, target=case.recorded.target or None, topics=list(case.recorded.topics)
        )
        with read_harness(output.settings(data_folder=data)) as runtime:
            differences = _differences(case, drive, judged_in(_mission(runtime, mission_id)))
    lines = differences or ["Every verdict is as it was."]
    output.show({"folder": str(folder), "differences": differences}, as_json=as_json, lines=lines)
    raise typer.Exit(1 if differences else 0)


def _mission(runtime: Runtime, mission_id: str) -> Mission:
    return runtime.mission(MissionId(mission_id))


def _differences(case: IncidentCase, drive: RecordedDrive, now: tuple[CaseCondition, ...]) -> list[str]:
    differences = [] if drive == case.recorded else ["The recording in the bundle is another one."]
    found = {one.condition_id: one for one in now}
    for one in case.judged:
        other = found.pop(one.condition_id, None)
        if other is None or other.verdict != one.verdict:
            differences.append(f"{one.condition_id}: {one.verdict}, now {other.verdict if other else 'not judged'}")
    return [*differences, *(f"{name}: not judged, now {one.verdict}" for name, one in found.items())]
