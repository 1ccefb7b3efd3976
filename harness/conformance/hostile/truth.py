"""Checks by simulated ground truth whether the body was where an accepted stage says it was; shares no rule with the
verifier.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

import msgspec

from harness.contracts.effects import Metric
from harness.contracts.events import DispatchIntended, MissionEvent, NodeCommitted, PacketRetained
from harness.contracts.simulation import TruePosition
from harness.contracts.tasks import Node, TaskContract

MARGIN_M = 0.05
"""How far a sound measurement may be off: the localiser's noise is 6 mm, and three samples are taken."""
DEPARTURE_M = 0.8
PASSED_M = 1.6
"""A waypoint counts as passed inside the corridor of 1.5 m round it, where a detour may lead; and a margin."""
BEFORE_S = 3.0
"""So many seconds before its first dispatch belong to a stage."""


class Position(Protocol):
    """Where the body truly was, metres, at a mission time."""

    @property
    def at_s(self) -> float: ...
    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...


def metric_of(node: Node) -> Metric | None:
    """The place or the route that a node is to reach; None for a node that goes nowhere."""
    return next((c.effect for c in node.success_conditions if isinstance(c.effect, Metric)), None)


def truly_reached(effect: Metric, truth: Sequence[Position], *, from_s: float, at_s: float) -> str:
    """Why the body was not where the effect requires it at an instant, by ground truth; empty if it was."""
    poses = [one for one in truth if one.at_s <= at_s]
    if not poses:
        return "nothing is known of the body"
    last = poses[-1]
    off_m = math.hypot(last.x_m - effect.target_m[0], last.y_m - effect.target_m[1])
    if off_m > effect.tolerance_m + MARGIN_M:
        return f"the body was {off_m:.2f} m from the target"
    if effect.predicate != "circuit":
        return ""
    way = [(one.x_m, one.y_m) for one in poses if one.at_s >= from_s]
    passed = 0
    for point in way:
        if passed < len(effect.route_m) and math.dist(point, effect.route_m[passed]) <= PASSED_M:
            passed += 1
    if max((math.dist(point, effect.target_m) for point in way), default=0.0) <= DEPARTURE_M:
        return "the body never left"
    if passed < len(effect.route_m):
        return f"the body passed {passed} of {len(effect.route_m)} waypoints"
    return ""


def untrue(contract: TaskContract, events: Sequence[MissionEvent], truth: Sequence[Position]) -> Iterator[str]:
    """Why accepted stages of one mission were not so in the simulated world, one sentence each."""
    packets = {one.packet.identity.packet_id: one.packet for one in events if isinstance(one, PacketRetained)}
    for event in events:
        if not isinstance(event, NodeCommitted):
            continue
        effect, packet = metric_of(contract.node(event.node_id)), packets[event.packet_id]
        if effect is None:
            continue
        dispatched = [
            one.dispatched_s for one in events if isinstance(one, DispatchIntended) and one.node_id == event.node_id
        ]
        why = truly_reached(effect, truth, from_s=min(dispatched) - BEFORE_S, at_s=packet.collected_s)
        if why:
            yield f"{event.node_id}: {why}"


def read_truth(folder: Path, mission_id: str) -> list[TruePosition]:
    """What a simulator's process wrote of one mission's truth in its own folder, in order of time; whole lines only."""
    file = folder / "truth" / f"{mission_id}.jsonl"
    lines = file.read_bytes().split(b"\n")[:-1] if file.exists() else []
    return sorted((msgspec.json.decode(line, type=TruePosition) for line in lines), key=lambda one: one.at_s)
