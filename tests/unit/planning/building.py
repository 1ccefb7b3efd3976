"""Builders for planning, routing and recovery: real contracts, missions, cards and contexts with one thing changed."""

from typing import Any

from msgspec.structs import replace

from harness.baseline.load import baseline, site
from harness.contexts.view import StateView
from harness.contracts.capabilities import CancelBehaviour, Capability, CapabilityCard, Estimates, Latency, Parameter
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.evidence import CommittedFact, EvidenceReference
from harness.contracts.ids import ConditionId, Digest, MissionId, NodeId, PacketId, ProviderId
from harness.contracts.proposals import Signature
from harness.contracts.protocol import RobotStatus
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import digest
from harness.planning.compile import compile_contract
from harness.planning.templates import by_name
from harness.projections.mission import Failure, Mission, NodeState, Spend

GOAL = "Help me go and check the office storage area"
NOW_S = 1000.0
CONFIGURATION = baseline()
SITE = site()
NAVIGATION = (
    Parameter(name="route", type="points", unit="m"),
    Parameter(name="target", type="point", unit="m"),
    Parameter(name="frame", type="frame"),
    Parameter(name="tolerance_m", type="number", unit="m", minimum=0.05, maximum=5.0),
    Parameter(name="speed_cap_mps", type="number", unit="m/s", minimum=0.05, maximum=0.5),
    Parameter(name="replan", type="boolean", required=False),
)


def template(name: str = "warehouse-inspection") -> TaskTemplate:
    return by_name(name, CONFIGURATION.templates)


def contract(name: str = "warehouse-inspection", **arguments: str | float) -> TaskContract:
    return compile_contract(goal=GOAL, template=template(name), arguments=arguments, site=SITE)


def mission(task: TaskContract | None = None, **nodes: NodeState) -> Mission:
    """An active mission; `nodes` replace fresh node states."""
    compiled = task or contract()
    states = {node.node_id: NodeState(node_id=node.node_id) for node in compiled.nodes}
    return Mission(
        mission_id=MissionId("m1"),
        k=3,
        status="active",
        contract=compiled,
        policy=CONFIGURATION.recovery,
        configuration=CONFIGURATION.configuration_id,
        nodes=states | {NodeId(name): state for name, state in nodes.items()},
    )


def failing(failure: FailureClass, *tried: RecoveryAction, node_id: str = "go", **changes: Any) -> NodeState:
    """A node whose last execution failed at NOW_S; `tried` are rungs authorised for the same class before."""
    return NodeState(
        node_id=NodeId(node_id),
        status="recovering",
        attempt=1 + len(tried),
        provider_id=ProviderId("route-follower"),
        failure=Failure(node_id=NodeId(node_id), failure=failure, reason="seen so", at_s=NOW_S),
        spends=tuple(spend(action, failure) for action in tried),
        **changes,
    )


def spend(action: RecoveryAction, failure: FailureClass) -> Spend:
    cost = 1 if action in ("re_perceive", "adjust_view", "retry", "local_replan", "switch_skill") else 0
    return Spend(failure=failure, action=action, cost=cost, attempt=1, signature=signature(action, failure), reason="")


def signature(
    action: RecoveryAction, failure: FailureClass, *, provider: str = "route-follower", parameters: str = "p"
) -> Signature:
    return Signature(
        action=action,
        provider_id=ProviderId(provider),
        provider_version="1",
        parameters=digest(parameters),
        failure=failure,
    )


def card(name: str = "route-follower", **changes: Any) -> CapabilityCard:
    return replace(
        CapabilityCard(
            provider_id=ProviderId(name),
            version="1",
            embodiments=("quadruped",),
            parameters=NAVIGATION,
            preconditions=("localised",),
            side_effects=("moves",),
            latency=Latency(base_s=5.0, per_metre_s=2.0),
            resources=(),
            cancel=CancelBehaviour(acknowledged=True, within_s=2.0),
            risk="low",
            failure_words=("no_progress",),
            evidence=("pose",),
            capability="navigate",
            estimates=Estimates(success=0.9, risk=0.1, uncertainty=0.1, cost=1.0),
            moves=True,
        ),
        **changes,
    )


def service(name: str, capability: Capability, *parameters: Parameter) -> CapabilityCard:
    """A card that moves nothing."""
    return card(name, capability=capability, parameters=parameters, preconditions=(), moves=False)


def status(**changes: Any) -> RobotStatus:
    return replace(
        RobotStatus(
            robot_id="vbot-1",
            at_s=NOW_S,
            posture="standing",
            armed=False,
            hardware_stop=False,
            charge=0.8,
            localised=True,
            map_version=SITE.map_version,
        ),
        **changes,
    )


def fact(node_id: str, name: str, *, k: int = 1, **arguments: Any) -> CommittedFact:
    return CommittedFact(
        name=name,
        kind="event",
        node_id=NodeId(node_id),
        condition_id=ConditionId(f"{node_id}.{name}"),
        packet_id=PacketId(f"pkt_{node_id}"),
        k=k,
        at_s=NOW_S - 10.0 + k,
        arguments=arguments,
        measured={},
    )


def sensed(at_s: float) -> EvidenceReference:
    """A sensor's observation of the whole mission at `at_s`."""
    return EvidenceReference(
        kind="pose",
        origin="sensor",
        source="odometry",
        from_s=at_s,
        until_s=at_s,
        confidence=1.0,
        blob=Digest("0" * 64),
    )


def view(state: Mission, **changes: Any) -> StateView:
    return replace(
        StateView(
            mission=state,
            at_s=NOW_S,
            rules=CONFIGURATION.context_rules,
            site=SITE,
            recovery=CONFIGURATION.recovery,
        ),
        **changes,
    )
