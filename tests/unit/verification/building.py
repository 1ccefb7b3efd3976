"""Builders for contexts and verification: conditions, packets, missions, and C3 compiled for real."""

from dataclasses import dataclass, field
from typing import Any

import msgspec
from msgspec.structs import replace

from harness.contexts.verifier import goal_context, verifier_context
from harness.contexts.view import StateView
from harness.contracts.capabilities import CancelBehaviour, CapabilityCard, Estimates, Latency
from harness.contracts.configuration import ContextRules
from harness.contracts.contexts import Context
from harness.contracts.effects import AnyEffect, Condition, Metric, Temporal
from harness.contracts.evidence import CommittedFact, EvidencePacket, EvidenceReference, PacketIdentity
from harness.contracts.ids import (
    ConditionId,
    Digest,
    InvocationId,
    MissionId,
    NodeId,
    PacketId,
    PlaceId,
    ProviderId,
    RequestId,
    sha256,
)
from harness.contracts.observations import AnySample, Trajectory
from harness.contracts.places import Place, Site
from harness.contracts.protocol import Receipt
from harness.contracts.tasks import Constraints, EvidencePolicy, Goal, Node, RecoveryLimits, TaskContract
from harness.contracts.values import Point, encode
from harness.contracts.verdicts import ConditionResult, GoalVerdict, NodeVerdict
from harness.projections.mission import Mission, NodeState
from harness.verification.facts import facts_of
from harness.verification.verdict import verify, verify_goal
from tests.unit.verification.drives import BEGAN_S, ROUTE, Drive

RULES = ContextRules(
    c1_items=24,
    c2_items=12,
    c2_examples=3,
    c3_items=16,
    c4_items=20,
    minimum_confidence=0.5,
    pose_age_s=1.0,
    image_age_s=30.0,
)
LIMITS = RecoveryLimits(re_perceive=2, adjust_view=2, retry=1, local_replan=2, switch_skill=1, total=4)
GOAL = Goal(text="Go to B", digest=sha256(b"Go to B"))
CIRCUIT: tuple[Point, ...] = ((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0), (0.0, 0.0))
SITE = Site(
    name="yard",
    frame="map",
    map_version="site-1",
    places=tuple(
        Place(
            place_id=PlaceId(name),
            name=name.upper(),
            frame="map",
            map_version="site-1",
            approach_m=at_m,
            provenance="surveyed",
            verification="configured",
            region_m=((at_m[0] - 1, at_m[1] - 1), (at_m[0] + 1, at_m[1] - 1), (at_m[0] + 1, at_m[1] + 1)),
        )
        for name, at_m in (("a", (0.0, 0.0)), ("b", ROUTE[-1]), ("pit", (4.0, 1.0)))
    ),
    routes=(),
)


def arrival(target: Point = ROUTE[-1], **changes: Any) -> Metric:
    effect = Metric(predicate="arrival", frame="map", map_version="site-1", target_m=target, tolerance_m=0.4)
    return replace(effect, **changes)


def circuit(**changes: Any) -> Metric:
    bounds = {"departure_m": 0.8, "progress": 0.95}
    return arrival(CIRCUIT[-1], predicate="circuit", route_m=CIRCUIT, bounds=bounds, **changes)


STATIC = Temporal(predicate="static_body", interval_s=1.0, bound=0.02)


def condition(effect: AnyEffect, name: str = "go.test", **changes: Any) -> Condition:
    return replace(Condition(condition_id=ConditionId(name), text="The test holds", effect=effect), **changes)


def node(*effects: AnyEffect, node_id: str = "go", **changes: Any) -> Node:
    """A medium-risk navigation node with these effects as its success conditions."""
    conditions = tuple(condition(effect, f"{node_id}.{effect.predicate}") for effect in effects or (arrival(),))
    return replace(
        Node(
            node_id=NodeId(node_id),
            subgoal=f"Do {node_id}",
            success_conditions=conditions,
            capabilities=("navigate",),
            parameters={"target": ROUTE[-1]},
            resources=(),
            evidence=EvidencePolicy(mandatory=()),
            timeout_s=100.0,
            recovery=LIMITS,
            risk="medium",
        ),
        **changes,
    )


def card(*sources: str, **changes: Any) -> CapabilityCard:
    return replace(
        CapabilityCard(
            provider_id=ProviderId("follower"),
            version="1",
            embodiments=("quadruped",),
            parameters=(),
            preconditions=(),
            side_effects=(),
            latency=Latency(base_s=1.0),
            resources=(),
            cancel=CancelBehaviour(acknowledged=True, within_s=2.0),
            risk="low",
            failure_words=(),
            evidence=(),
            capability="navigate",
            estimates=Estimates(success=0.9, risk=0.1, uncertainty=0.1, cost=1.0),
            moves=True,
            sources=sources or ("localiser", "lidar"),
        ),
        **changes,
    )


def contract(*nodes: Node, completion: tuple[Condition, ...] = (), **changes: Any) -> TaskContract:
    return replace(
        TaskContract(
            goal=GOAL,
            nodes=nodes or (node(),),
            completion_conditions=completion or (condition(arrival(), "goal.test"),),
            constraints=Constraints(speed_cap_mps=0.5),
            recovery_total=8,
            template="test",
            frame="map",
            map_version="site-1",
        ),
        **changes,
    )


def mission(task: TaskContract | None = None, **changes: Any) -> Mission:
    """An active mission at k = 3 whose nodes are fresh."""
    compiled = task or contract()
    return replace(
        Mission(
            mission_id=MissionId("m1"),
            k=3,
            status="active",
            contract=compiled,
            configuration=Digest("c" * 64),
            nodes={one.node_id: NodeState(node_id=one.node_id) for one in compiled.nodes},
        ),
        **changes,
    )


@dataclass
class Bench:
    """Blobs, and packets made of them."""

    blobs: dict[Digest, bytes] = field(default_factory=dict)

    def keep(self, body: bytes) -> Digest:
        digest = sha256(body)
        self.blobs[digest] = body
        return digest

    def blob(self, digest: Digest) -> bytes:
        return self.blobs[digest]

    def trajectory(self, samples: Trajectory, **changes: Any) -> EvidenceReference:
        times = [one.at_s for one in (*samples.poses, *samples.odometry, *samples.imu)]
        return replace(
            EvidenceReference(
                kind="trajectory",
                origin="sensor",
                source="robot",
                from_s=min(times, default=0.0),
                until_s=max(times, default=0.0),
                confidence=0.95,
                blob=self.keep(encode(samples)),
                frame="map",
                map_version="site-1",
            ),
            **changes,
        )

    def driven(self, drive: Drive, *, name: str = "go-1", node_id: str = "go", **changes: Any) -> EvidencePacket:
        """The packet of a drive, collected as it ends."""
        return self.packet(
            name,
            node_id=node_id,
            dispatched_s=drive.from_s,
            terminal_s=drive.stopped_s,
            collected_s=drive.until_s,
            estimates=(self.trajectory(drive.trajectory()),),
            **changes,
        )

    def packet(self, name: str = "go-1", *, node_id: str = "go", **changes: Any) -> EvidencePacket:
        return replace(
            EvidencePacket(
                identity=PacketIdentity(
                    mission_id=MissionId("m1"),
                    node_id=NodeId(node_id),
                    attempt=1,
                    request_id=RequestId(f"r-{name}"),
                    invocation_id=InvocationId(f"i-{name}"),
                    packet_id=PacketId(name),
                    provider_id=ProviderId("follower"),
                    provider_version="1",
                ),
                k_ctx=3,
                configuration=Digest("c" * 64),
                dispatched_s=BEGAN_S,
                terminal_s=BEGAN_S + 1,
                collected_s=BEGAN_S + 2,
                terminal="succeeded",
                failure="",
                declared={},
                before=(),
                after=(),
                estimates=(),
                proposed=(),
            ),
            **changes,
        )

    def judged(self, packet: EvidencePacket, state: Mission | None = None, **kwargs: Any) -> NodeVerdict:
        """C3 compiled from the mission's state, and the verdict on it."""
        return verify(self.c3(packet, state, **kwargs), self.blob)

    def c3(
        self,
        packet: EvidencePacket,
        state: Mission | None = None,
        *,
        provider: CapabilityCard | None = None,
        **more: Any,
    ) -> Context:
        return verifier_context(view(state or mission(), at_s=packet.collected_s, **more), packet, provider or card())

    def goal(self, state: Mission, *, at_s: float, recent: tuple[AnySample, ...] = ()) -> GoalVerdict:
        return verify_goal(goal_context(view(state, at_s=at_s, recent=recent)), self.blob)

    def committed(self, state: Mission, packet: EvidencePacket, verdict: NodeVerdict) -> Mission:
        """The mission after the gate accepted this packet: what later nodes and the goal build on."""
        node_id, k = packet.identity.node_id, state.k + 1
        declared = state.contract.node(node_id) if state.contract else node()
        done = replace(
            state.nodes[node_id],
            status="committed",
            committed_k=k,
            packets=(*state.nodes[node_id].packets, packet),
            verdicts=(*state.nodes[node_id].verdicts, verdict),
        )
        facts = facts_of(verdict, packet=packet, node=declared, k=k)
        return replace(state, k=k, nodes=state.nodes | {node_id: done}, facts=state.facts + facts)


def retained(state: Mission, *packets: EvidencePacket) -> Mission:
    """The mission with packets that were judged before and did not commit."""
    nodes = dict(state.nodes)
    for packet in packets:
        known = nodes[packet.identity.node_id]
        nodes[packet.identity.node_id] = replace(known, packets=(*known.packets, packet))
    return replace(state, nodes=nodes)


def view(state: Mission, *, at_s: float = BEGAN_S, **changes: Any) -> StateView:
    return replace(StateView(mission=state, at_s=at_s, rules=RULES, site=SITE), **changes)


def receipt(kind: Any, *, at_s: float, name: str = "", **changes: Any) -> Receipt:
    return replace(
        Receipt(
            receipt_id=name or f"{kind}-{at_s}", kind=kind, at_s=at_s, source="follower", request_id=RequestId("r-go-1")
        ),
        **changes,
    )


def fact(name: str, node_id: str, **arguments: Any) -> CommittedFact:
    return CommittedFact(
        name=name,
        kind="event",
        node_id=NodeId(node_id),
        condition_id=ConditionId(f"{node_id}.{name}"),
        packet_id=PacketId(f"{node_id}-1"),
        k=2,
        at_s=BEGAN_S - 10,
        arguments=msgspec.to_builtins(arguments),
        measured={},
    )


def only(verdict: NodeVerdict | GoalVerdict, name: str = "") -> ConditionResult:
    """The one result, or the one of this condition."""
    found = [one for one in verdict.results if name in ("", one.condition_id)]
    assert len(found) == 1
    return found[0]
