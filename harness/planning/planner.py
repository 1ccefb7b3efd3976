"""Pure: the planning role. It proposes the next node from C1; it starts, commits and promises nothing."""

import msgspec

from harness.contracts.contexts import Context
from harness.contracts.decisions import Refused
from harness.contracts.ids import NodeId
from harness.contracts.proposals import PlanProposal
from harness.projections.mission import Mission, eligible


class _Open(msgspec.Struct, frozen=True):
    """What the planner reads of one node on the frontier."""

    node_id: NodeId
    subgoal: str = ""
    waiting_for: str = ""
    attempt: int = 0


def plan(context: Context) -> PlanProposal:
    """The first node of C1's record `frontier` that waits for nothing, else the first that waits. C1 is all it sees.

    Raises msgspec.ValidationError if the record is not a list of nodes.
    """
    record = context.one("frontier")
    frontier = record.read(tuple[_Open, ...]) if record else ()
    if not frontier:
        return PlanProposal(node_id=None, reason="No node is eligible: each one is done, failed or waits for another.")
    chosen = next((node for node in frontier if not node.waiting_for), frontier[0])
    others = ", ".join(node.node_id for node in frontier if node is not chosen) or "none"
    waits = f", although it waits for {chosen.waiting_for}" if chosen.waiting_for else ""
    return PlanProposal(
        node_id=chosen.node_id,
        reason=f"{chosen.node_id} ({chosen.subgoal}) is the first eligible node in the graph{waits}; others: {others}.",
    )


def plan_refusal(proposal: PlanProposal, *, mission: Mission) -> Refused | None:
    """Why this plan may not be taken up, whoever made it, a model included; None if it may (R41)."""
    if mission.status != "active":
        return Refused("not_active", f"The mission is {mission.status}; nothing is planned now.")
    if mission.invocation is not None:
        return Refused("in_flight", f"{mission.invocation.intent.node_id} is still being done; one at a time (D3).")
    if proposal.node_id is None:
        return None
    if proposal.node_id not in mission.nodes:
        return Refused("unknown_node", f"The graph has no node {proposal.node_id[:80]!r}.")
    ready = eligible(mission)
    if proposal.node_id in ready:
        return None
    return Refused("not_eligible", f"{proposal.node_id} may not start now; eligible: {', '.join(ready) or 'none'}.")


def admissible(proposal: PlanProposal, *, mission: Mission) -> bool:
    """Whether `plan_refusal` has nothing against this plan."""
    return plan_refusal(proposal, mission=mission) is None
