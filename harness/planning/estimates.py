"""Orders the stages that may come next by what a world model estimates of their targets. Pure; decides nothing else."""

from harness.contracts.contexts import Context
from harness.contracts.estimates import ESTIMATE, TargetEstimates
from harness.contracts.ids import NodeId
from harness.contracts.proposals import PlanProposal
from harness.contracts.reasons import because
from harness.planning.planner import Planner, plan


def by_estimate(context: Context) -> PlanProposal:
    """The stage with the best estimate, where the first one of the graph's order has an estimate too.

    Without estimates, and for a stage without one, it is the graph's order. Ties keep that order.
    """
    own = plan(context)
    scores: dict[NodeId, float] = {}
    for record in context.all(ESTIMATE):
        found = record.read(TargetEstimates)
        scores |= {name: score for name, score in found.scores.items() if score > scores.get(name, -1.0)}
    if own.node_id is None or own.node_id not in scores:
        return own
    best = max(scores, key=lambda name: (scores[name], name == own.node_id))
    if best == own.node_id:
        return own
    reason = because("best_estimate", node_id=best, score=scores[best], over=own.node_id, other=scores[own.node_id])
    return PlanProposal(node_id=best, reason=reason)


ESTIMATED_ORDER = Planner(name="estimated-order-1", plan=by_estimate)
"""Graph order, but between stages with targets the order of their estimates."""
