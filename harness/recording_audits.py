"""Audits a team's recordings: how many of the successes that they declare lack evidence, and of which kind.

Recordings are read one by one, each in a process with limits; what cannot be read is listed with its reason. Results
are kept in the data folder by path, size and time of change, so that an audit that was ended goes on where it was.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from harness.adapters.limited_process import run_limited
from harness.adapters.pictures import size_of
from harness.adapters.providers.recording.limits import recording_limits
from harness.adapters.providers.recording.reader import Recording, open_recording
from harness.adapters.providers.recording.segments import DeclaredSegment, Segment
from harness.adapters.providers.recording.topics import TopicSettings
from harness.adapters.providers.recording.trajectory_reader import trajectory_format
from harness.adapters.stores.audit_results import AuditResults
from harness.contracts.declared_successes import AuditedRecording, BagAudit, DeclaredSuccess
from harness.contracts.errors import HarnessError, RecordingInvalid, UnknownName
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode
from harness.verification.declared_success import judged

SUFFIXES = (".mcap", ".mcap.zstd", ".bag", ".db3")
TEXTS = (".csv", ".txt", ".log")
SAME_S = 2.0
"""Declarations so close belong to one success: a navigator and its controller both say it."""
METADATA = "metadata.yaml"
ARRIVAL = (
    r"(?i:GOAL REACHED|goal succeeded|reached the goal|goal was reached|goal reached)"
    r"(?:.*?(?P<distance_m>\d+(?:\.\d+)?)\s*m\b)?"
)
"""What supervisors write: this harness's own, Nav2's navigator and controller, move_base."""


class RecordingToAudit(Value):
    """What the process that reads one recording is asked; `topics` is JSON."""

    path: str
    topics: str


def recordings_in(folder: Path) -> tuple[Path, ...]:
    """Recordings under a folder, by name: files, and rosbag2 folders as one each. Raises UnknownName for no folder."""
    if not folder.is_dir():
        raise UnknownName(because("bag_folder_absent"), where=str(folder))
    return tuple(_found(folder))


def _found(folder: Path) -> Iterator[Path]:
    if (folder / METADATA).exists() or (folder / "times.txt").exists():
        yield folder
        return
    for one in sorted(folder.iterdir()):
        if one.is_symlink() or one.name.startswith("."):
            continue
        if one.is_dir():
            yield from _found(one)
        elif one.name.lower().endswith(SUFFIXES) or (one.suffix.lower() in TEXTS and trajectory_format(one)):
            yield one


def audited_folder(
    folder: Path,
    data: Path,
    *,
    topics: TopicSettings,
    again: bool = False,
    watch: Callable[[AuditedRecording, int, int], None] = lambda one, number, total: None,
) -> BagAudit:
    """Audit every recording of a folder; each result is stored before the next is read.

    `again`: also those that were read before. `watch` gets each result, its number from 1, and how many there are.
    """
    found = recordings_in(folder)
    results = AuditResults(data, folder)
    known = {} if again else {one.path: one for one in results.read()}
    settings = sha256(topics.model_dump_json().encode())
    audited: list[AuditedRecording] = []
    for number, path in enumerate(found, start=1):
        size_bytes, changed_ns = _marks(path)
        name = path.name if path == folder else str(path.relative_to(folder))
        before = known.get(name)
        if before is not None and (before.size_bytes, before.changed_ns, before.settings) == (
            size_bytes,
            changed_ns,
            settings,
        ):
            one = before
        else:
            one = _audited(
                path,
                topics,
                AuditedRecording(path=name, size_bytes=size_bytes, changed_ns=changed_ns, settings=settings),
            )
            results.append(one)
        audited.append(one)
        watch(one, number, len(found))
    audit = BagAudit(folder=str(folder.absolute()), recordings=tuple(audited))
    results.replace(audit.recordings)
    return audit


def audit_one(request: bytes) -> bytes:
    """One recording's declared successes, judged, in this very process. Raises RecordingInvalid."""
    task = decode(request, RecordingToAudit)
    topics = TopicSettings.model_validate_json(task.topics)
    with open_recording(Path(task.path), topics, recover=True, size_of=size_of) as recording:
        summary = recording.summary()
        found = judged(declared_successes(recording), recording.samples(), single_source=summary.single_source)
        return encode(
            AuditedRecording(
                path="",
                size_bytes=0,
                changed_ns=0,
                settings=Digest(""),
                sha256=recording.sha256,
                duration_s=recording.duration_s,
                incomplete=summary.incomplete,
                successes=found,
            )
        )


def declared_successes(recording: Recording) -> tuple[DeclaredSuccess, ...]:
    """Every arrival that the recorded supervisor declared, with the target of its leg where the recording names one."""
    segments = recording.segments()
    arrivals: list[DeclaredSegment] = []
    for one in recording.declarations():
        if one.kind == "arrival" and not (arrivals and one.at_s - arrivals[-1].at_s < SAME_S):
            arrivals.append(one)
    return tuple(_success(line, segments) for line in arrivals)


def _success(line: DeclaredSegment, segments: tuple[Segment, ...]) -> DeclaredSuccess:
    leg = next((one for one in reversed(segments) if one.dispatched_s <= line.at_s and one.target_m), None)
    return DeclaredSuccess(
        name=leg.name if leg else "",
        at_s=line.at_s,
        text=line.text[:500],
        target_m=leg.target_m if leg else None,
        declared_distance_m=line.distance_m,
    )


def _audited(path: Path, topics: TopicSettings, head: AuditedRecording) -> AuditedRecording:
    request = RecordingToAudit(path=str(path.absolute()), topics=topics.model_dump_json(exclude_unset=True))
    try:
        answer = run_limited(
            audit_one, encode(request), recording_limits(path), failure=RecordingInvalid, where=path.name
        )
    except HarnessError as error:
        return msgspec.structs.replace(head, problem=error.what)
    found = decode(answer, AuditedRecording)
    return msgspec.structs.replace(
        found, path=head.path, size_bytes=head.size_bytes, changed_ns=head.changed_ns, settings=head.settings
    )


def _marks(path: Path) -> tuple[int, int]:
    """Size and newest change of a recording's files together."""
    files = [path] if path.is_file() else [one for one in path.iterdir() if one.is_file()]
    stats = [one.stat() for one in files]
    return sum(one.st_size for one in stats), max((one.st_mtime_ns for one in stats), default=0)
