"""The planning role: proposes the next node from C1. Pure: it starts and commits nothing."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from harness.contracts.contexts import Context
from harness.contracts.decisions import Refused, refused
from harness.contracts.errors import HarnessError, ModelFailed
from harness.contracts.ids import NodeId
from harness.contracts.models import ModelUse
from harness.contracts.proposals import PlanProposal
from harness.contracts.reasons import Explanation, Fact, Reason, because
from harness.projections.mission import Mission, eligible

LONGEST_REASON = 1000


class _Open(msgspec.Struct, frozen=True):
    """What the planner reads of one node on the frontier."""

    node_id: NodeId
    subgoal: str = ""
    waiting_for: Explanation = ""
    attempt: int = 0


def plan(context: Context) -> PlanProposal:
    """The first node of C1's record `frontier` that waits for nothing, else the first that waits. C1 is all it sees.

    Raises msgspec.ValidationError if the record is not a list of nodes.
    """
    record = context.one("frontier")
    frontier = record.read(tuple[_Open, ...]) if record else ()
    if not frontier:
        return PlanProposal(node_id=None, reason=because("no_node_eligible"))
    chosen = next((node for node in frontier if not node.waiting_for), frontier[0])
    others = tuple(node.node_id for node in frontier if node is not chosen) or ("none",)
    reason = (
        because(
            "first_waiting",
            node_id=chosen.node_id,
            subgoal=chosen.subgoal,
            waiting_for=chosen.waiting_for,
            others=others,
        )
        if chosen.waiting_for
        else because("first_eligible", node_id=chosen.node_id, subgoal=chosen.subgoal, others=others)
    )
    return PlanProposal(node_id=chosen.node_id, reason=reason)


@dataclass(frozen=True)
class Planner:
    """Proposes the next node from C1, under a name that is stored in the log. A proposal has no authority (R41).

    A model behind `plan` may answer anything or raise; the harness admits its proposal or takes its own.
    """

    name: str
    plan: Callable[[Context], PlanProposal]


GRAPH_ORDER = Planner(name="graph-order-1", plan=plan)
"""The deterministic planner: no model, no prose."""


def plan_refusal(proposal: PlanProposal, *, mission: Mission) -> Refused | None:
    """Why this plan may not be used, whoever made it, a model included; None if it may (R41)."""
    if mission.status != "active":
        return refused("not_active", because("nothing_planned_now", status=mission.status))
    if mission.invocation is not None:
        return refused("in_flight", node_id=mission.invocation.intent.node_id)
    if proposal.node_id is None:
        return None
    if proposal.node_id not in mission.nodes:
        return refused("unknown_node", because("node_not_in_graph", node_id=proposal.node_id[:80]))
    ready = eligible(mission)
    if proposal.node_id in ready:
        return None
    if not ready:
        return refused("not_eligible", because("no_node_startable", node_id=proposal.node_id))
    return refused("not_eligible", because("node_not_startable", node_id=proposal.node_id, eligible=tuple(ready)))


@dataclass(frozen=True)
class Plan:
    """What is done next: the planner's proposal where the harness admits it, else the harness's own.

    `proposal` is the planner's proposal, cut to what can be stored; None if there was nothing usable. `use`: the
    model that was asked, whatever came of it.
    """

    node_id: NodeId | None
    reason: Explanation
    planner: str
    proposal: PlanProposal | None
    refused: Explanation = ""
    use: ModelUse | None = None


def planned(planner: Planner, context: Context, *, mission: Mission) -> Plan:
    """Ask the planner, then admit or refuse its proposal. A planner that fails or proposes nothing stops nothing."""
    own = plan(context)
    try:
        proposal = _storable(planner.plan(context))
    except Exception as error:  # noqa: BLE001 - a planner that breaks has proposed nothing, whatever broke it
        problem: Fact = error.reason if isinstance(error, HarnessError) else _short(str(error))
        unusable = because("proposed_nothing_usable", planner=planner.name, kind=type(error).__name__, error=problem)
        use = error.use if isinstance(error, ModelFailed) else None
        return Plan(
            node_id=own.node_id,
            reason=own.reason,
            planner=planner.name,
            proposal=None,
            refused=unusable,
            use=use,
        )
    use = proposal.use if isinstance(proposal.use, ModelUse) else None
    broken = plan_refusal(proposal, mission=mission)
    if broken is None and proposal.node_id is None and own.node_id is not None:
        broken = refused("work_left", node_id=own.node_id)
    if broken is not None:
        return Plan(
            node_id=own.node_id,
            reason=own.reason,
            planner=planner.name,
            proposal=proposal,
            refused=broken.reason,
            use=use,
        )
    return Plan(node_id=proposal.node_id, reason=proposal.reason, planner=planner.name, proposal=proposal, use=use)


def _storable(proposal: PlanProposal) -> PlanProposal:
    """The proposal as text that the log can hold. Raises TypeError if it is no proposal."""
    if not isinstance(proposal, PlanProposal):
        raise TypeError(f"{type(proposal).__name__} is no plan")
    node_id = NodeId(_short(proposal.node_id)) if proposal.node_id is not None else None
    reason = proposal.reason if isinstance(proposal.reason, Reason) else _short(proposal.reason)
    return PlanProposal(node_id=node_id, reason=reason, use=proposal.use)


def _short(text: str) -> str:
    return text.encode("utf-8", "replace").decode()[:LONGEST_REASON]
