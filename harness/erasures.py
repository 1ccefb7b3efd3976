"""Erases voice and photographs: the tombstone is committed first, then the bytes go. No other blob is ever erased."""

from harness.auditing.dossier import mission_blobs
from harness.contracts.actors import Actor, Command
from harness.contracts.any_events import AnyEvent
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.erasure_events import ERASURES, EraseBlob, ExpireBlob, erasure_stream, medium_of
from harness.contracts.ids import Digest, MissionId
from harness.projections.mission import Mission
from harness.runtime import Runtime


def erase(runtime: Runtime, digest: Digest, *, actor: Actor, reason: str) -> Decision[AnyEvent]:
    """Erase one photograph or voice in a person's name; what is erased already stays so, with its first reason.

    Refuses any other blob, and one that a mission which is not over builds on. Raises BlobDamaged for bytes that are
    missing or changed.
    """
    if runtime.erasure(digest) is not None:
        return Accepted(())
    body = runtime.blob(digest)
    medium = medium_of(body)
    if medium is None:
        return refused("blob_not_erasable")
    if needed := _needing(runtime, digest):
        return refused("blob_in_use", mission_id=needed)
    command = EraseBlob(actor=actor, reason=reason, digest=digest, medium=medium, size_bytes=len(body))
    return _erased(runtime, digest, command)


def expire(runtime: Runtime, mission: Mission, *, after_days: float) -> tuple[Digest, ...]:
    """Erase every photograph and voice of a mission that ended so long ago, by the site's rule; returns which."""
    gone = []
    for digest, body in mission_blobs(runtime, mission.mission_id).items():
        medium = medium_of(body)
        if medium is None or _needing(runtime, digest):
            continue
        command = ExpireBlob(
            digest=digest,
            medium=medium,
            size_bytes=len(body),
            after_days=after_days,
            mission_id=mission.mission_id,
        )
        _erased(runtime, digest, command)
        gone.append(digest)
    return tuple(gone)


def finish_erasures(runtime: Runtime) -> int:
    """Remove bytes whose tombstone stands: a process was killed between the two, or a backup brought them back.

    Returns how many. Only for the owner of the data folder.
    """
    erased = (Digest(stream.removeprefix(ERASURES)) for stream in runtime.streams(ERASURES))
    left = [digest for digest in erased if runtime.has_blob(digest)]
    for digest in left:
        runtime.remove_erased(digest)
    return len(left)


def _erased(runtime: Runtime, digest: Digest, command: Command) -> Decision[AnyEvent]:
    decision = runtime.decide([(erasure_stream(digest), command)])
    if not isinstance(decision, Refused):
        runtime.remove_erased(digest)
    return decision


def _needing(runtime: Runtime, digest: Digest) -> MissionId | None:
    """A mission that is not over and whose events name the blob."""
    name = digest.encode()
    for mission in runtime.open_missions():
        if any(name in event.body for event in runtime.events(mission.mission_id)):
            return mission.mission_id
    return None
