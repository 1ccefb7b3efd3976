"""Cases of the goal's predicates over several stages: in_order, one_chain, one_subject.

The order is that of the robot's start journal; what was sent and where it was done is drawn, and then recorded, rightly
or not.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np
from msgspec.structs import replace

from experiments.verifier.cases import (
    CaseInputs,
    K,
    VerifierCase,
    condition_id_of,
    fact,
    goal_of,
    packet_of,
    shown_goal,
    stage,
)
from experiments.verifier.executions import TICK_S, SimulatedExecution, placed
from experiments.verifier.polygons import depth, drawn
from harness.contracts.effects import Relational, Symbolic, Temporal
from harness.contracts.evidence import CommittedFact, DeclaredEffect
from harness.contracts.ids import ConditionId, Digest, MissionId, NodeId, PacketId, RequestId, sha256
from harness.contracts.protocol import TERMINAL, InvocationIdentity, PhysicalStart, StartRequest
from harness.contracts.values import Point
from harness.projections.mission import Mission
from simulator.cards import OBSERVER

ANYTHING = Symbolic(predicate="recorded_request", arguments={})
EDGE_M = 0.05
BEGAN_S = 1_790_000_000.0


@dataclass(frozen=True)
class Journal:
    """The robot's own journal of physical starts, and when each ended."""

    starts: tuple[PhysicalStart, ...]
    ends: tuple[float, ...]


def journals(seed: int, *, count: int) -> tuple[Journal, ...]:
    """So many runs of three to six stages, one after the other."""
    chance = Random(seed)
    return tuple(_journal(chance, seed + index) for index in range(count))


def orders(chance: Random, count: int, pool: Sequence[Journal]) -> Iterator[VerifierCase]:
    """in_order: a wanted order of stages, the robot's true one, and the supervisor's record of it."""
    names = (
        "none", "none", "none", "wanted order is another", "a wanted stage never ran", "ends recorded in another order",
        "acceptances recorded in another order", "clock stepped back", "a stage not accepted", "a stage only declared",
        "a fact of level 0", FORGED,
    )  # fmt: skip
    for _ in range(count):
        yield _order(chance.choice(names), chance, chance.choice(pool))


FORGED = "record forged: ends and acceptances in the wanted order"
FORGED_CHAIN = "record forged: other images were sent than the facts say"


def chains(chance: Random, count: int) -> Iterator[VerifierCase]:
    """one_chain: which images were truly taken, analysed and sent, for which request, and what the facts say."""
    names = (
        "none", "none", "none", "images of another panorama sent", "frames of another panorama analysed",
        "request of another goal", "a stage of another mission", "a stage not accepted", "a fact missing",
        "a fact of level 0", "an image too many sent", FORGED_CHAIN,
    )  # fmt: skip
    for number in range(count):
        yield _chain(chance.choice(names), chance, number)


def subjects(chance: Random, count: int, runs: Sequence[SimulatedExecution]) -> Iterator[VerifierCase]:
    """one_subject: where a stage truly was, what it truly analysed and what was told, against the clause's place."""
    names = (
        "none", "none", "none", "place of the images unknown", "another floor analysed", "another analysis told",
        "target of another map", "no fact", "a fact of level 0", BIASED,
    )  # fmt: skip
    for number in range(count):
        yield _subject(chance.choice(names), chance, chance.choice(runs), number)


BIASED = "localiser biased: the images are recorded at another place"


def _journal(chance: Random, seed: int) -> Journal:
    robot = placed((0.0, 0.0, 0.0), seed=seed)
    ends = []
    for index in range(chance.randint(3, 6)):
        identity = InvocationIdentity(
            mission_id=MissionId("campaign"),
            node_id=NodeId(f"stage-{index}"),
            attempt=1,
            request_id=RequestId(f"r-{seed}-{index}"),
            provider_id=OBSERVER.provider_id,
        )
        request = StartRequest(
            identity=identity,
            capability="observe",
            parameters={"duration_s": chance.uniform(0.2, 1.5)},
            k_ctx=1,
            configuration=Digest("c" * 64),
            deadline_s=robot.at_s + 60.0,
            fencing={},
        )
        next(one for one in robot.providers() if one.card is OBSERVER).start(request)
        while (found := robot.find(identity.request_id)) is not None and found.status not in TERMINAL:
            robot.advance_to(robot.at_s + TICK_S)
        ends.append(found.at_s if found else robot.at_s)
        robot.advance_to(robot.at_s + chance.uniform(0.1, 0.6))
    return Journal(tuple(robot.starts()), tuple(ends))


def _order(name: str, chance: Random, journal: Journal) -> VerifierCase:
    ran = [start.node_id for start in journal.starts]
    order = sorted(chance.sample(range(len(ran)), chance.randint(2, len(ran))))
    if name in ("wanted order is another", FORGED):
        while order == sorted(order):
            chance.shuffle(order)
    nodes = [ran[index] for index in order]
    if name == "a wanted stage never ran":
        nodes[chance.randrange(len(nodes))] = NodeId("never")
    ends = list(journal.ends)
    accepted = [K + 1 + index for index in range(len(ran))]
    a, b = sorted(chance.sample(range(len(ran)), 2))
    if name == "ends recorded in another order":
        ends[a], ends[b] = ends[b], ends[a]
    if name == "acceptances recorded in another order":
        accepted[a], accepted[b] = accepted[b], accepted[a]
    if name == "clock stepped back":
        ends = [end - (40.0 if index >= b else 0.0) for index, end in enumerate(ends)]
    if name == FORGED:
        for place, index in enumerate(order):
            ends[index], accepted[index] = journal.ends[sorted(order)[place]], K + 1 + sorted(order)[place]
    effect = Temporal(predicate="in_order", interval_s=1.0, bound=1.0, nodes=tuple(nodes))
    gone = {ran[order[0]]} if name == "a stage not accepted" else set()
    only = ran[order[-1]] if name == "a stage only declared" else None
    stages = [stage(ANYTHING, node_id=one) for one in ran]
    packets, facts = {}, []
    for index, node in enumerate(stages):
        if node.node_id in gone:
            continue
        packet = packet_of(node, OBSERVER, from_s=journal.starts[index].at_s, until_s=ends[index])
        packets[node.node_id] = (packet, accepted[index])
        low = name == "a fact of level 0" and index == order[0]
        if node.node_id != only:
            facts.append(_accepted("recorded_request", node.node_id, packet.identity.packet_id, low=low))
    inputs = shown_goal((effect,), stages, packets, {}, at_s=journal.ends[-1] + 100.0, facts=facts)
    if only is not None:
        inputs = _declared(inputs, only, packets)
    truth = _ordered(nodes, journal)
    return VerifierCase("in_order", name, truth, inputs, condition_id_of(effect, "goal"), epistemic=name == FORGED)


def _ordered(nodes: Sequence[NodeId], journal: Journal) -> bool:
    """Whether the robot's journal holds these stages' starts, each after the end of the one before."""
    at = {start.node_id: (start.at_s, end) for start, end in zip(journal.starts, journal.ends, strict=True)}
    if any(name not in at for name in nodes):
        return False
    return all(at[a][1] <= at[b][0] for a, b in itertools.pairwise(nodes))


def _declared(inputs: CaseInputs, node_id: NodeId, packets: dict[NodeId, Any]) -> CaseInputs:
    """The same goal, where one stage was only declared by its provider."""
    mission = inputs.view.mission
    state = mission.nodes[node_id]
    effect = DeclaredEffect(
        name="recorded_request",
        node_id=node_id,
        condition_id=ConditionId(f"{node_id}.recorded_request"),
        text="Declared only",
        packet_id=packets[node_id][0].identity.packet_id,
        at_s=0.0,
        arguments={},
        measured={},
    )
    ended = replace(state, status="declared", committed_k=None, declared_k=packets[node_id][1])
    mission = replace(mission, nodes={**mission.nodes, node_id: ended}, declared=(effect,))
    return _of_state(inputs, mission)


def _of_state(inputs: CaseInputs, mission: Mission) -> CaseInputs:
    """What is shown, of another state."""
    return CaseInputs(
        view=replace(inputs.view, mission=mission), blobs=inputs.blobs, packet=inputs.packet, card=inputs.card
    )


def _accepted(name: str, node_id: str, packet_id: PacketId, *, low: bool = False, **arguments: Any) -> CommittedFact:
    return fact(name, node_id, arguments, packet_id=packet_id, independence=0 if low else 2)


def _chain(name: str, chance: Random, number: int) -> VerifierCase:
    frames = [sha256(f"own {number} {index}".encode()) for index in range(8)]
    foreign = [sha256(f"other {number} {index}".encode()) for index in range(8)]
    goal, other = goal_of(), goal_of("Walk the circuit and come back")
    analysed = frames[:5] + foreign[:1] if name == "frames of another panorama analysed" else list(frames)
    sent = chance.sample(frames, 4)
    if name == "images of another panorama sent":
        sent[chance.randrange(4)] = foreign[3]
    if name == "an image too many sent":
        sent.append(foreign[0])
    request = other.digest if name == "request of another goal" else goal.digest
    listed = chance.sample(frames, 4) if name == FORGED_CHAIN else sent
    truly_sent = foreign[:4] if name == FORGED_CHAIN else sent
    truth = set(truly_sent) <= set(analysed) <= set(frames) and request == goal.digest
    names = ["request", "panorama", "analysis", "delivery"]
    stages = [stage(ANYTHING, node_id=NodeId(one)) for one in names]
    gone = chance.choice(("delivery", "request")) if name == "a stage not accepted" else ""
    packets = {}
    for index, node in enumerate(stages):
        if node.node_id == gone:
            continue
        packet = packet_of(node, OBSERVER, from_s=BEGAN_S + 10.0 * index, until_s=BEGAN_S + 10.0 * index + 5.0)
        if name == "a stage of another mission" and index == 2:
            packet = replace(packet, identity=replace(packet.identity, mission_id=MissionId("another")))
            truth = False
        packets[node.node_id] = (packet, K + 1 + index)
    level = 0 if name == "a fact of level 0" else 2
    facts = [
        fact("recorded_request", "request", {"digest": request}),
        fact("panorama", "panorama", {"frames": frames}),
        fact("passage_checked", "analysis", {"frames": analysed}, independence=level),
        fact("message_stored", "delivery", {"frames": listed, "text_digest": sha256(b"text")}),
    ]
    if name == "a fact missing":
        facts.pop(chance.randrange(4))
    facts = [one for one in facts if one.node_id != gone]
    facts = [_on_packet(one, packets) for one in facts]
    effect = Relational(predicate="one_chain", relation="linked", subject="delivery", object="request")
    inputs = shown_goal((effect,), stages, packets, {}, at_s=BEGAN_S + 100.0, facts=facts, goal=goal)
    return VerifierCase(
        "one_chain", name, truth, inputs, condition_id_of(effect, "goal"), epistemic=name == FORGED_CHAIN
    )


def _on_packet(one: CommittedFact, packets: dict[NodeId, Any]) -> CommittedFact:
    found = packets.get(one.node_id)
    return replace(one, packet_id=found[0].identity.packet_id) if found else one


def _subject(name: str, chance: Random, run: SimulatedExecution, number: int) -> VerifierCase:
    poses = run.between(run.from_s, run.until_s).poses
    pose = chance.choice(poses)
    true = run.true_at(pose.at_s)[:2]
    away_m, angle = chance.choice((0.0, 0.3, 1.0, 4.0)), chance.uniform(-math.pi, math.pi)
    middle = (true[0] + away_m * math.cos(angle), true[1] + away_m * math.sin(angle))
    region = drawn(chance, middle, radius_m=chance.uniform(0.8, 3.0))
    measured: Point = (pose.x_m, pose.y_m)
    if name == BIASED:
        measured = (measured[0] + chance.uniform(-4.0, 4.0), measured[1] + chance.uniform(-4.0, 4.0))
    frames = [sha256(f"frame {number} {index}".encode()) for index in range(8)]
    goes = chance.random() < 0.35
    floor = drawn(chance, true, radius_m=0.15)
    if name == "another floor analysed":
        floor = drawn(chance, (true[0] + 6.0, true[1]), radius_m=0.3)
    sent = frames[:4] if name != "another analysis told" else [*frames[:3], sha256(f"other {number}".encode())]
    subject = "go" if goes else "analysis"
    level = 0 if name == "a fact of level 0" else 2
    facts = _facts_of(name, subject, measured, floor, frames, sent, level=level)
    effect = Relational(
        predicate="one_subject",
        relation="one_subject",
        subject=subject,
        object="place",
        frame="map",
        map_version="site-1",
        region_m=region,
    )
    names = ("go",) if goes else ("panorama", "analysis", "delivery")
    stages = [stage(ANYTHING, node_id=NodeId(one)) for one in names]
    packets = {
        node.node_id: (
            packet_of(node, OBSERVER, from_s=BEGAN_S + 10.0 * index, until_s=BEGAN_S + 10.0 * index + 5.0),
            K + 1 + index,
        )
        for index, node in enumerate(stages)
    }
    inputs = shown_goal((effect,), stages, packets, {}, at_s=BEGAN_S + 100.0, facts=facts)
    truth = _of_place(true, floor, region, goes=goes)
    if not goes and name == "another analysis told":
        truth = False
    if goes and name == "target of another map":
        truth = False
    return VerifierCase("one_subject", name, truth, inputs, condition_id_of(effect, "goal"), epistemic=name == BIASED)


def _facts_of(
    name: str,
    subject: str,
    at_m: Point,
    floor: Sequence[Point],
    frames: list[Digest],
    sent: list[Digest],
    *,
    level: int,
) -> list[CommittedFact]:
    if name == "no fact":
        return []
    if subject == "go":
        version = "site-0" if name == "target of another map" else "site-1"
        target = {"frame": "map", "map_version": version, "target_m": list(at_m), "tolerance_m": 0.4}
        return [fact("arrival", "go", target, independence=level)]
    place = {} if name == "place of the images unknown" else {"x_m": at_m[0], "y_m": at_m[1]}
    return [
        fact("panorama", "panorama", {"frames": frames}, measured=place),
        fact(
            "passage_checked",
            "analysis",
            {"object": "panorama", "frames": frames, "report": sha256(b"report"), "region_m": [list(p) for p in floor]},
            independence=level,
        ),
        fact("message_stored", "delivery", {"frames": sent, "text_digest": sha256(b"text")}),
    ]


def _of_place(true: Point, floor: Sequence[Point], region: Sequence[Point], *, goes: bool) -> bool | None:
    """Whether the body truly was in the region, and all of the analysed floor lies there."""
    points = np.array([true] if goes else [true, *floor])
    deepest = float(depth(points, region).min())
    return True if deepest > EDGE_M else False if deepest < -EDGE_M else None
