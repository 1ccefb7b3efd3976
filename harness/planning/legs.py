"""Builds the stage that drives the body to a chosen point, with the conditions that measure its arrival. Pure."""

from harness.contracts.effects import Condition, Metric, Precondition, Temporal
from harness.contracts.ids import ConditionId, NodeId, ResourceId
from harness.contracts.tasks import EvidencePolicy, Node, RecoveryLimits, TaskContract
from harness.contracts.values import Point

TOLERANCE_M = 0.40


def leg(
    contract: TaskContract,
    name: NodeId,
    target_m: Point,
    *,
    subgoal: str,
    arrived: str,
    route_m: tuple[Point, ...],
    depends_on: tuple[NodeId, ...],
    timeout_s: float,
    recovery: RecoveryLimits,
    required: bool = True,
) -> Node:
    """A leg to `target_m` along `route_m`, in the contract's frame; `arrived` is the text of its first condition."""
    return Node(
        node_id=name,
        subgoal=subgoal,
        success_conditions=_conditions(contract, name, target_m, arrived),
        capabilities=("navigate",),
        parameters={
            "route": route_m,
            "target": target_m,
            "frame": contract.frame,
            "tolerance_m": TOLERANCE_M,
            "speed_cap_mps": contract.constraints.speed_cap_mps,
        },
        resources=(ResourceId("mobile_base"),),
        evidence=EvidencePolicy(mandatory=("trajectory",)),
        timeout_s=timeout_s,
        recovery=recovery,
        depends_on=depends_on,
        preconditions=(Precondition(predicate="localised"), Precondition(predicate="hardware_stop_released")),
        required=required,
        risk="medium",
    )


def _conditions(contract: TaskContract, name: NodeId, target_m: Point, arrived: str) -> tuple[Condition, ...]:
    there = Metric(
        predicate="arrival",
        frame=contract.frame,
        map_version=contract.map_version,
        target_m=target_m,
        tolerance_m=TOLERANCE_M,
    )
    still = Temporal(predicate="static_body", interval_s=1.0, bound=0.02)
    return (
        Condition(condition_id=ConditionId(f"{name}.arrival"), text=arrived, effect=there),
        Condition(
            condition_id=ConditionId(f"{name}.static"), text="The body is static after the execution", effect=still
        ),
    )
