"""Applies a graph revision or a dispute to a mission's state. Nothing that was accepted is deleted. Pure."""

from msgspec.structs import replace

from harness.contracts.revision_events import CompletionDisputed, GraphRevised
from harness.projections import mission


def revised(m: mission.Mission, event: GraphRevised) -> mission.Mission:
    """Reopened stages begin again, with what was spent on them; their earlier results are kept separately."""
    contract = event.contract or mission.required_contract(m)
    remaining = {node.node_id for node in contract.nodes}
    closed = [node_id for node_id in m.nodes if node_id in event.reopened or node_id not in remaining]
    history = tuple(
        mission.SupersededResult(
            revision=event.revision,
            state=replace(m.of(node_id), status="superseded"),
            facts=tuple(fact for fact in m.facts if fact.node_id == node_id),
        )
        for node_id in closed
    )
    nodes = {
        node.node_id: m.nodes.get(node.node_id, mission.NodeState(node_id=node.node_id))
        if node.node_id not in event.reopened
        else _anew(m.of(node.node_id))
        for node in contract.nodes
    }
    payer = nodes[event.responsible]
    spend = mission.Spend(
        failure=event.failure,
        action="local_replan",
        cost=1,
        attempt=payer.attempt,
        signature=None,
        reason=event.reason,
    )
    nodes[event.responsible] = replace(
        payer,
        spends=payer.spends if event.cause == "recovery" else (*payer.spends, spend),
        failure=None,
        begun_at=payer.attempt,
        status="recovering" if payer.status in ("rejected", "recovering", "escalated") else payer.status,
    )
    return replace(
        m,
        k=m.k + 1,
        status="active",
        contract=contract,
        graph_revision=event.revision,
        nodes=nodes,
        facts=tuple(fact for fact in m.facts if fact.node_id not in closed),
        declared=tuple(effect for effect in m.declared if effect.node_id not in closed),
        history=(*m.history, *history),
    )


def _anew(state: mission.NodeState) -> mission.NodeState:
    """Pending again. Attempts go on counting, so that no request id repeats; spends stay spent."""
    return mission.NodeState(
        node_id=state.node_id,
        attempt=state.attempt,
        begun_at=state.attempt,
        spends=state.spends,
        excluded=state.excluded,
    )


def disputed(m: mission.Mission, event: CompletionDisputed) -> mission.Mission:
    """The accepted fact and those that depend on it are marked, and stay in the state (D21)."""
    accepted = {fact.condition_id: fact for fact in m.facts}
    marked = [
        mission.DisputedFact(
            condition_id=condition_id,
            packet_id=fact.packet_id,
            node_id=fact.node_id,
            root=condition_id == event.condition_id,
            actor=event.actor,
            reason=event.reason,
        )
        for condition_id in (event.condition_id, *event.dependents)
        if (fact := accepted.get(condition_id)) is not None
    ]
    return replace(m, k=m.k + 1, disputes=(*m.disputes, *marked))
