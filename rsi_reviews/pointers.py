"""Folds the stream of the release pointer, which says what new missions are pinned to, and answers questions about it.
Pure.
"""

from collections.abc import Iterable
from typing import Literal, assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.ids import Digest, MissionId, RobotId, StreamId
from harness.contracts.values import Count, Name, Value
from harness.projections.mission import Mission
from rsi_reviews import events
from rsi_reviews.contracts import ReleasePolicy

POINTER = StreamId("release/pointer")
Draining = Literal["inactive", "active", "draining", "drained"]


def candidate_stream(candidate: Digest) -> StreamId:
    return StreamId(f"candidate/{candidate}")


class Uptake(Value):
    """The time since which a worker works under a revision."""

    worker: Name
    revision: Count
    at_s: float


class Pointer(Value):
    """`configuration` holds for every robot, `canary` for `robot_id` while a canary runs. Revisions only rise.

    `released`, `trial` and `rollback` as in PointerMoved.
    """

    version: Count = 0
    revision: Count = 0
    configuration: Digest = Digest("")
    rollback: Digest = Digest("")
    released: Digest | None = None
    canary: Digest | None = None
    trial: Digest | None = None
    robot_id: RobotId | None = None
    policy: ReleasePolicy = ReleasePolicy()
    history: tuple[events.PointerMoved, ...] = ()
    quarantined: dict[Digest, events.ConfigurationQuarantined] = msgspec.field(default_factory=dict)
    retired: frozenset[Digest] = frozenset()
    looks: tuple[events.HeldOutLooked, ...] = ()
    uptakes: tuple[Uptake, ...] = ()
    receipts: dict[str, events.Signed] = msgspec.field(default_factory=dict)

    def standing(self, configuration: Digest) -> events.PointerMoved | None:
        """The latest move after which this configuration was current everywhere."""
        return next((move for move in reversed(self.history) if move.configuration == configuration), None)

    def look_of(self, candidate: Digest) -> events.HeldOutLooked | None:
        return next((look for look in self.looks if look.candidate == candidate), None)


def apply(pointer: Pointer, event: events.PointerEvent) -> Pointer:
    """The pointer after one event."""
    pointer = replace(pointer, version=pointer.version + 1)
    match event:
        case events.PointerMoved():
            return replace(
                pointer,
                revision=event.revision,
                configuration=event.configuration,
                rollback=event.rollback,
                released=event.released,
                canary=event.canary,
                trial=event.trial,
                robot_id=event.robot_id,
                history=(*pointer.history, event),
            )
        case events.ConfigurationQuarantined():
            return replace(pointer, quarantined={**pointer.quarantined, event.configuration: event})
        case events.PolicySaved():
            return replace(pointer, policy=event.policy, receipts={**pointer.receipts, event.by.key: event.by})
        case events.HeldOutLooked():
            return replace(pointer, looks=(*pointer.looks, event))
        case events.UptakeRecorded():
            uptake = Uptake(worker=event.worker, revision=event.revision, at_s=event.at_s)
            return replace(pointer, uptakes=(*pointer.uptakes, uptake))
        case events.VersionRetired():
            return replace(
                pointer,
                retired=pointer.retired | {event.configuration},
                receipts={**pointer.receipts, event.by.key: event.by},
            )
        case _:
            assert_never(event)


def current_at(pointer: Pointer, instant_s: float, *, robot_id: RobotId | None = None) -> Digest | None:
    """What a mission that began at this instant was pinned to; None before the first move.

    `instant_s` is wall time. On the canary's robot it is the canary, where the pointer named one.
    """
    moved = next((move for move in reversed(pointer.history) if move.at_s <= instant_s), None)
    if moved is None:
        return None
    if moved.canary is not None and robot_id is not None and robot_id == moved.robot_id:
        return moved.canary
    return moved.configuration


def pins(missions: Iterable[Mission]) -> dict[Digest, tuple[MissionId, ...]]:
    """Unfinished missions by the version they are pinned to."""
    pinned: dict[Digest, tuple[MissionId, ...]] = {}
    for mission in missions:
        if not mission.ended:
            pinned[mission.configuration] = (*pinned.get(mission.configuration, ()), mission.mission_id)
    return pinned


def versions(
    pointer: Pointer, known: Iterable[Digest], pinned: dict[Digest, tuple[MissionId, ...]], *, current: Digest
) -> dict[Digest, Draining]:
    """Active: new missions get it. Draining: only older missions still run under it. Drained: no mission does
    any more.

    `current` is what new missions get; before the pointer's first move that is the shipped version.
    """
    seen = {digest for move in pointer.history for digest in (move.configuration, move.canary) if digest is not None}
    states: dict[Digest, Draining] = {}
    for digest in (*seen, *known):
        if digest in (current, pointer.canary):
            states[digest] = "active"
        elif pinned.get(digest):
            states[digest] = "draining"
        else:
            states[digest] = "drained" if digest in seen else "inactive"
    return states
