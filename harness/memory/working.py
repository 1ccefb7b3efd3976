"""Pure: working memory. The active graph and control state, read off the mission's fold; nothing is stored (R136)."""

from harness.contracts.ids import HandoffId, InvocationId, MissionId, NodeId, ProviderId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Value
from harness.projections.mission import Mission, MissionStatus, NodeStatus, eligible, required_contract


class Working(Value):
    """What is under way now: the graph with its states, who acts, what may come next, what recovery has left."""

    mission_id: MissionId
    k: Count
    status: MissionStatus
    graph: dict[NodeId, NodeStatus]
    frontier: tuple[NodeId, ...]
    acting: InvocationId | None
    provider_id: ProviderId | None
    waiting_for: HandoffId | None
    vetoes: dict[str, Explanation]
    recovery_left: int


def working(mission: Mission) -> Working:
    """Working memory of a compiled mission; ValueError before its contract."""
    contract, invocation = required_contract(mission), mission.invocation
    return Working(
        mission_id=mission.mission_id,
        k=mission.k,
        status=mission.status,
        graph={node_id: state.status for node_id, state in mission.nodes.items()},
        frontier=() if mission.ended else eligible(mission),
        acting=invocation.intent.invocation_id if invocation else None,
        provider_id=invocation.intent.provider_id if invocation else None,
        waiting_for=mission.handoff_id,
        vetoes=mission.vetoes,
        recovery_left=max(0, contract.recovery_total - mission.spent_total),
    )
