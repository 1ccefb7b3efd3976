"""Revises a contract so that the robot waits out of the way, at another place, before a stage goes on. Pure.

A leg to the place and a stage that stands there come before it; the stage itself, its conditions and the goal stay.
"""

from msgspec.structs import replace

from harness.contracts.effects import Condition, Metric, Precondition, Temporal
from harness.contracts.ids import ConditionId, NodeId, ResourceId
from harness.contracts.places import Place
from harness.contracts.tasks import EvidencePolicy, Node, RecoveryLimits, TaskContract
from harness.contracts.values import Point
from harness.planning import legs

ASIDE, WAIT = "aside", "wait"
LEG_TIMEOUT_S = 180.0
LONGER_S, LATE_S = 2.0, 30.0
"""The observation lasts this much longer than the wait, and times out after this much more."""
ONCE = RecoveryLimits(re_perceive=0, adjust_view=0, retry=1, local_replan=0, switch_skill=0, total=1)


def waited_at(
    contract: TaskContract, node: Node, place: Place, *, route_m: tuple[Point, ...], wait_s: float
) -> TaskContract:
    """The contract with a leg along `route_m` to the place and `wait_s` seconds there, before `node`."""
    number = 1 + sum(one.node_id.startswith(f"{ASIDE}-") for one in contract.nodes)
    aside, stand = NodeId(f"{ASIDE}-{number}"), NodeId(f"{WAIT}-{number}")
    leg = legs.leg(
        contract,
        aside,
        place.approach_m,
        subgoal=f"Go to {place.name} to wait there",
        arrived=f"The body is at {place.name}, measured",
        route_m=route_m,
        depends_on=node.depends_on,
        timeout_s=LEG_TIMEOUT_S,
        recovery=_within(node.recovery, ONCE),
    )
    later = replace(node, depends_on=(*node.depends_on, stand))
    at = contract.nodes.index(node)
    stay = _stay(contract, stand, place, after=aside, wait_s=wait_s, recovery=leg.recovery)
    return replace(contract, nodes=(*contract.nodes[:at], leg, stay, later, *contract.nodes[at + 1 :]))


def _stay(
    contract: TaskContract, name: NodeId, place: Place, *, after: NodeId, wait_s: float, recovery: RecoveryLimits
) -> Node:
    there = Metric(
        predicate="arrival",
        frame=contract.frame,
        map_version=contract.map_version,
        target_m=place.approach_m,
        tolerance_m=legs.TOLERANCE_M,
    )
    stood = Condition(
        condition_id=ConditionId(f"{name}.stood"),
        text=f"The body stood at {place.name} for {wait_s:g} s, by its poses and its odometry",
        effect=Temporal(predicate="stable", interval_s=wait_s, bound=2.0, inner=there),
    )
    return Node(
        node_id=name,
        subgoal=f"Wait {wait_s:g} s at {place.name}",
        success_conditions=(stood,),
        capabilities=("observe",),
        parameters={"duration_s": wait_s + LONGER_S, "frames": 0.0},
        resources=(ResourceId("mobile_base"),),
        evidence=EvidencePolicy(mandatory=("trajectory",)),
        timeout_s=wait_s + LATE_S,
        recovery=recovery,
        depends_on=(after,),
        preconditions=(
            Precondition(predicate="at_place", target_m=place.approach_m, tolerance_m=legs.TOLERANCE_M),
            Precondition(predicate="static"),
        ),
    )


def _within(one: RecoveryLimits, limits: RecoveryLimits) -> RecoveryLimits:
    """The smaller of both budgets, name by name."""
    return RecoveryLimits(
        **{name: min(getattr(one, name), getattr(limits, name)) for name in RecoveryLimits.__struct_fields__}
    )
