"""Erasure of voice and photographs: the bytes go, what was decided on them stays, and a tombstone says who and why."""

from typing import Literal

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import Digest, MissionId, StreamId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Positive

Medium = Literal["photograph", "voice"]
ERASURES = "erasure/"
"""Every erased blob has a stream of its own, named by its digest: that the stream exists says that it was erased."""


class EraseBlob(Command, tag=True):
    """A person has one blob erased. What it holds and its size are read from it, never said."""

    actor: Actor
    reason: Name
    digest: Digest
    medium: Medium
    size_bytes: Count


class ExpireBlob(Command, tag=True):
    """The site's retention rule has one blob erased: it belongs to a mission that ended `after_days` ago."""

    digest: Digest
    medium: Medium
    size_bytes: Count
    after_days: Positive
    mission_id: MissionId


class BlobErased(Event, tag=True):
    """The bytes of this digest may no longer be stored here. `ended_mission`: whose end the retention rule counted
    from; empty where a person asked."""

    digest: Digest
    medium: Medium
    size_bytes: Count
    actor: Actor
    reason: Explanation
    at_s: float
    ended_mission: str = ""


ErasureCommand = EraseBlob | ExpireBlob


def erasure_stream(digest: Digest) -> StreamId:
    return StreamId(f"{ERASURES}{digest}")


def medium_of(body: bytes) -> Medium | None:
    """Photograph or voice, by the first bytes; None for measurements, documents and everything else."""
    if body.startswith((b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n")):
        return "photograph"
    return "voice" if body[:4] == b"RIFF" and body[8:12] == b"WAVE" else None
