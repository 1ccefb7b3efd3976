"""Collects a mission's dossier from the log, and checks one that was opened. Reads no file, signs nothing."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import msgspec

from harness.auditing.places import PlaceChange, place_changes, place_differences, place_history
from harness.auditing.replay import ReplayReport, replay_mission
from harness.contracts import ids
from harness.contracts.dossier import EVENTS, FORMAT, RECORDS, DossierContents, JudgedGoal
from harness.contracts.erasure_events import BlobErased, erasure_stream
from harness.contracts.errors import BlobDamaged, UnknownName
from harness.contracts.ports import Record, StoredEvent
from harness.contracts.reasons import Reason, because
from harness.contracts.spoken_goals import SpokenGoal, Transcription
from harness.contracts.values import Count, Value, decode, encode
from harness.projections.judged_goal import judged_goal
from harness.projections.mission import Mission
from harness.projections.unverified import UnverifiedPart, unverified_parts
from harness.runtime import Runtime

_DIGEST = re.compile(rb"[0-9a-f]{64}")
_EVIDENCE = re.compile(rb'"(?:blob|sound|recognition|report|recording|transcript)":"([0-9a-f]{64})"')
"""How events, records and documents name a blob that something rests on."""
_DOCUMENT = b"{"
"""What a blob begins with that can cite others; pictures, sounds and point clouds begin otherwise."""


@dataclass(frozen=True)
class DossierContent:
    """The contents to sign and the files they name."""

    contents: DossierContents
    files: Mapping[str, bytes]


class DossierVerdict(Value):
    """What an offline check found. `differences` of the replay are empty for a sound dossier.

    `reconstructed`: decisions whose command was inferred from events, in a log from before commands were stored.
    `places` are the changes to places up to the mission's end; a dossier of an earlier release has none. `judged` is
    the goal verdict by clause as the events say it; None for a mission without a reading. `unverified`: its unverified
    parts, as the same events say. `spoken`: what the goal was
    written down from; None where it was typed. `erased` are the tombstones of evidence that was erased before the
    export, `unrepeated` the verdicts that cannot be derived again without it.
    """

    mission_id: ids.MissionId
    status: str
    events: int
    records: int
    blobs: int
    absent: tuple[ids.Digest, ...]
    public_key: str
    trusted: bool
    head_position: int
    head_digest: ids.Digest
    differences: tuple[Reason, ...]
    places: tuple[PlaceChange, ...] = ()
    reconstructed: Count = 0
    judged: JudgedGoal | None = None
    unverified: tuple[UnverifiedPart, ...] = ()
    spoken: SpokenGoal | None = None
    erased: tuple[BlobErased, ...] = ()
    unrepeated: Count = 0


def collect(
    runtime: Runtime,
    mission_id: ids.MissionId,
    *,
    exported_by: str,
    exported_at_s: float,
    attached: Mapping[str, bytes] = MappingProxyType({}),
) -> DossierContent:
    """Events of the mission, its handoffs and its places, every record and blob they cite, directly or through others.

    `attached` are files for people, by name: signed like the others, and nothing is derived from them. Raises
    UnknownName for a mission that does not exist.
    """
    mission = runtime.mission(mission_id)
    own = _history(runtime, mission)
    bodies = b"\n".join(event.body for event in own)
    records, files, gone = _resolved(runtime, _cited(bodies) | {mission.configuration})
    citing = (bodies, *(record.body for record in records), *(body for body in files.values() if _cites(body)))
    needed = {ids.Digest(found.decode()) for body in citing for found in _EVIDENCE.findall(body)}
    tombstones = [event for digest in gone for event in runtime.stream(erasure_stream(digest))]
    events = sorted((*own, *tombstones), key=lambda event: event.position)
    commands, _, _ = _resolved(runtime, _cited(b"\n".join(event.body for event in tombstones)) - gone)
    records = list({one.digest: one for one in (*records, *commands)}.values())
    files[EVENTS] = b"".join(encode(event) + b"\n" for event in events)
    files[RECORDS] = b"".join(encode(record) + b"\n" for record in records)
    files.update(attached)
    contents = DossierContents(
        format=FORMAT,
        mission_id=mission_id,
        robot_id=mission.robot_id,
        goal=mission.goal,
        status=mission.status,
        configuration=mission.configuration,
        exported_by=exported_by,
        exported_at_s=exported_at_s,
        head=runtime.head(),
        events=len(events),
        records=len(records),
        files={name: ids.sha256(body) for name, body in sorted(files.items())},
        absent=tuple(sorted(digest for digest in needed - gone if f"blobs/{digest}" not in files)),
        judged=judged_goal(mission) or msgspec.UNSET,
        spoken=mission.spoken,
        erased=tuple(sorted(gone)) or msgspec.UNSET,
    )
    return DossierContent(contents=contents, files=files)


def mission_blobs(runtime: Runtime, mission_id: ids.MissionId) -> dict[ids.Digest, bytes]:
    """Every sound blob that a mission cites, directly or through others. Raises UnknownName."""
    mission = runtime.mission(mission_id)
    bodies = b"\n".join(event.body for event in _history(runtime, mission))
    _, files, _ = _resolved(runtime, _cited(bodies))
    return {ids.Digest(name.removeprefix("blobs/")): body for name, body in files.items()}


def judge(runtime: Runtime, contents: DossierContents, *, public_key: str, trusted: bool) -> DossierVerdict:
    """Fold and derive again what the dossier holds, and compare it with its own statements."""
    mission = runtime.mission(contents.mission_id)
    report: ReplayReport = replay_mission(runtime, contents.mission_id, alone=True)
    differences = [*report.differences, *place_differences(runtime, mission), *_without_tombstone(runtime, contents)]
    if mission.status != contents.status:
        differences.append(because("dossier_status_differs", stated=contents.status, folded=mission.status))
    spoken = mission.spoken if isinstance(mission.spoken, SpokenGoal) else None
    differences += _spoken_differences(runtime, mission, spoken) if spoken else []
    if contents.spoken != mission.spoken:
        differences.append(because("dossier_speech_differs"))
    judged = judged_goal(mission)
    if contents.judged is not msgspec.UNSET and contents.judged != judged:
        differences.append(because("dossier_judgement_differs"))
    return DossierVerdict(
        mission_id=contents.mission_id,
        status=mission.status,
        events=contents.events,
        records=contents.records,
        blobs=sum(name.startswith("blobs/") for name in contents.files),
        absent=contents.absent,
        erased=_erasures(runtime, contents),
        unrepeated=report.erased,
        public_key=public_key,
        trusted=trusted,
        head_position=contents.head.position,
        head_digest=contents.head.digest,
        differences=tuple(differences),
        places=place_changes(runtime, mission),
        reconstructed=report.reconstructed,
        judged=judged,
        unverified=unverified_parts(mission),
        spoken=spoken,
    )


def _spoken_differences(runtime: Runtime, mission: Mission, spoken: SpokenGoal) -> list[Reason]:
    """Why the goal is not what its recording was written down as."""
    missing = tuple(one for one in (spoken.recording, spoken.transcript) if not _sound(runtime, one))
    if missing:
        return [because("dossier_speech_missing", digests=missing)]
    try:
        transcript = decode(runtime.blob(spoken.transcript), Transcription)
    except msgspec.MsgspecError:
        return [because("dossier_transcript_unreadable")]
    differences = []
    if len({ids.sha256(transcript.text.encode()), ids.sha256(mission.goal.encode()), spoken.checksum}) > 1:
        differences.append(because("dossier_goal_of_other_transcript"))
    if transcript.recording != spoken.recording:
        differences.append(because("dossier_transcript_of_other_recording"))
    return differences


def _history(runtime: Runtime, mission: Mission) -> list[StoredEvent]:
    """The events of the mission, its handoffs, its leases and its places, in the order of the log."""
    streams = (event for stream in _streams(runtime, mission) for event in runtime.stream(stream))
    return sorted((*streams, *place_history(runtime, mission)), key=lambda event: event.position)


def _streams(runtime: Runtime, mission: Mission) -> list[ids.StreamId]:
    handoffs = [
        stream
        for stream in runtime.streams("handoff/")
        if (opened := runtime.fold(stream).opened) is not None and opened.mission_id == mission.mission_id
    ]
    return [ids.mission_stream(mission.mission_id), *_lease_streams(runtime, mission), *handoffs]


def _lease_streams(runtime: Runtime, mission: Mission) -> list[ids.StreamId]:
    """Leases are shared with other missions; their streams are needed whole to repeat the decisions."""
    body = b"\n".join(event.body for event in runtime.events(mission.mission_id))
    return [stream for stream in runtime.streams("lease/") if stream.removeprefix("lease/").encode() in body]


def _erasures(runtime: Runtime, contents: DossierContents) -> tuple[BlobErased, ...]:
    found = (runtime.erasure(digest) for digest in contents.erased or ())
    return tuple(one for one in found if one is not None)


def _without_tombstone(runtime: Runtime, contents: DossierContents) -> Iterator[Reason]:
    """Blobs that the dossier calls erased though no event in it says so."""
    for digest in contents.erased or ():
        if runtime.erasure(digest) is None:
            yield because("dossier_erasure_without_event", digest=digest)


def _cited(body: bytes) -> set[ids.Digest]:
    return {ids.Digest(found.decode()) for found in _DIGEST.findall(body)}


def _cites(blob: bytes) -> bool:
    return blob.startswith(_DOCUMENT)


def _resolved(runtime: Runtime, cited: set[ids.Digest]) -> tuple[list[Record], dict[str, bytes], set[ids.Digest]]:
    """Records and blobs among these digests, and among those that they cite in turn; and which blobs were erased.

    A look by lidar or a recognition is a blob that names others, and a verdict rests on those too.
    """
    gone: set[ids.Digest] = set()
    records: list[Record] = []
    blobs: dict[str, bytes] = {}
    seen: set[ids.Digest] = set()
    while cited:
        digest = cited.pop()
        if digest in seen:
            continue
        seen.add(digest)
        try:
            record = runtime.record(digest)
        except UnknownName:
            if runtime.erasure(digest) is not None:
                gone.add(digest)
            elif _sound(runtime, digest):
                body = blobs[f"blobs/{digest}"] = runtime.blob(digest)
                cited |= _cited(body) if _cites(body) else set()
        else:
            records.append(record)
            cited |= _cited(record.body)
    return sorted(records, key=lambda one: one.digest), blobs, gone


def _sound(runtime: Runtime, digest: ids.Digest) -> bool:
    if not runtime.has_blob(digest):
        return False
    try:
        runtime.blob(digest)
    except BlobDamaged:
        return False
    return True
