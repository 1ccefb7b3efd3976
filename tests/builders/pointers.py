"""Builds the smallest possible release process: one stream with a pointer, and new missions are pinned to its
version.
"""

from typing import Any

from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.actors import Actor, Command, Event
from harness.contracts.configuration import Configuration
from harness.contracts.configuration_record import configuration_record
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.ids import Digest, RobotId, StreamId
from harness.contracts.values import Moment, Value
from harness.runtime import Runtime

POINTER = StreamId("pointer/all")
RELEASER = Actor(name="grace", role="releaser")


class Pointer(Value):
    """The pointer's version; none at first. `revision` rises with every move."""

    configuration: Digest | None = None
    revision: int = 0


class Point(Command, tag=True):
    configuration: Digest


class Pointed(Event, tag=True):
    configuration: Digest


def decide(state: Pointer, command: Point, now: Moment) -> Decision[Pointed]:
    """Accepts every version except the one it already points at."""
    if state.configuration == command.configuration:
        return refused("current")
    return Accepted((Pointed(configuration=command.configuration),))


def apply(state: Pointer, event: Pointed) -> Pointer:
    return replace(state, configuration=event.configuration, revision=state.revision + 1)


DECIDERS: dict[str, Decider[Any, Any, Any]] = {
    "pointer": Decider(initial=Pointer(), apply=apply, decide=decide, codec=Codec(Pointed))
}


def select(runtime: Runtime, robot_id: RobotId) -> Digest | None:
    """The pointer's version in the log."""
    pointer: Pointer = runtime.fold(POINTER)
    return pointer.configuration


def release(runtime: Runtime, configuration: Configuration) -> Digest:
    """Move the pointer, with the version's bytes in the same decision; returns its id."""
    version = configuration_record(configuration)
    decision = runtime.decide([(POINTER, Point(configuration=version.digest))], records=(version,))
    assert isinstance(decision, Accepted), decision
    return version.digest


def sterner(pose_age_s: float = 0.9) -> Configuration:
    """H_0 with one changed number in three of its sections, each of which a mission's records show."""
    base = baseline()
    return replace(
        base,
        context_rules=replace(base.context_rules, pose_age_s=pose_age_s),
        routing=replace(base.routing, history=0.9),
        recovery=replace(base.recovery, wait_s=33.0),
    )
