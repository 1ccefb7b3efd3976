"""Decides whether a plan, restriction or dispute counts. None of them removes a limit or a fact. Pure."""

from functools import reduce

from msgspec.structs import replace

from harness.contracts.commands import AuthoriseDispatch
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.events import FailureClassified, HandoffAnswered, MissionEvent
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.reasons import because
from harness.contracts.revision_commands import (
    DisputeCompletion,
    PassOverStep,
    ReviseContract,
    RevisedPlan,
    ReviseToRecover,
    TightenConstraints,
)
from harness.contracts.revision_events import (
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)
from harness.contracts.tasks import TaskContract, order
from harness.contracts.values import digest
from harness.gate.dispatch import accounted, beyond, misbound, spend, unready
from harness.planning.restrictions import tightest
from harness.planning.revision import revision_refusal
from harness.projections.mission import Mission, required_contract, required_policy
from harness.projections.mission_fold import apply
from harness.recovery.approval import approval_required
from harness.recovery.rules import first_broken_recovery
from harness.recovery.state import left_now, over_budget

REPLANNING = ("local_replan",)
"""Steps that are worth nothing without another plan: they are never carried out as a repetition."""


def revise(mission: Mission, command: ReviseContract) -> Decision[MissionEvent]:
    """A planner's graph, if it keeps what a plan may not change. It costs its stage one local_replan (R47, R131)."""
    if mission.status != "active":
        return refused("not_active", because("nothing_planned_now", status=mission.status))
    if mission.invocation is not None:
        return refused("in_flight", node_id=mission.invocation.intent.node_id)
    node = mission.nodes.get(command.node_id)
    if node is None or node.status in ("committed", "declared", "failed", "superseded"):
        return refused("no_open_stage", because("stage_not_open_to_plan", node_id=command.node_id[:80]))
    if command.node_id not in {one.node_id for one in command.contract.nodes}:
        return refused("node_removed", because("plan_without_its_stage", node_id=command.node_id))
    broken = _unpaid(mission, command) or revision_refusal(mission, command.contract)
    if broken:
        return broken
    left = left_now(mission, command.node_id)
    revised = GraphRevised(
        revision=mission.graph_revision + 1,
        cause="planner",
        responsible=command.node_id,
        reopened=(),
        reason=command.reason,
        failure=node.failure.failure if node.failure else "no_progress",
        contract=command.contract,
        proposed_by=command.planner,
        left_node=left[0] - 1,
        left_mission=left[1] - 1,
    )
    return Accepted((revised,))


def revise_to_recover(mission: Mission, command: ReviseToRecover) -> Decision[MissionEvent]:
    """A recovery step that changes the graph: the spend and the revision are one commit (D49).

    The step is bound to the ladder, the budgets and the approvals like any other.
    """
    if mission.status != "active":
        return refused("not_active", because("nothing_planned_now", status=mission.status))
    if mission.invocation is not None:
        return refused("in_flight", node_id=mission.invocation.intent.node_id)
    state, proposal = mission.nodes.get(command.node_id), command.proposal
    if state is None or state.failure is None:
        return refused("no_failure", because("nothing_to_recover", node_id=command.node_id))
    broken = first_broken_recovery(
        mission,
        node_id=command.node_id,
        proposal=proposal,
        signature=command.signature,
        policy=required_policy(mission),
    ) or revision_refusal(mission, command.contract, reopened=command.reopened)
    if broken:
        return broken
    needed = approval_required(
        mission=mission,
        node=required_contract(mission).node(command.node_id),
        action=proposal.action,
        moves=False,
        share=required_policy(mission).approval_share,
    )
    if needed:
        return refused("approval_required", why=needed)
    paid = spend(state, proposal, attempt=state.attempt + 1, context=command.context, until_s=None)
    left = left_now(mission, command.node_id)
    revised = GraphRevised(
        revision=mission.graph_revision + 1,
        cause="recovery",
        responsible=command.node_id,
        reopened=command.reopened,
        reason=command.reason,
        failure=state.failure.failure,
        contract=command.contract,
        proposed_by=command.planner,
        left_node=left[0] - proposal.cost,
        left_mission=left[1] - proposal.cost,
    )
    return Accepted((accounted(mission, replace(paid, signature=command.signature)), revised))


def start_revised(mission: Mission, command: AuthoriseDispatch, plan: RevisedPlan) -> Decision[MissionEvent]:
    """A person approved another plan with the first start on it: answer, spend, revision and intent are one commit.

    The plan is bound to the budgets and to everything that a plan may not change; the start to the revised contract.
    """
    state, step = mission.nodes.get(plan.node_id), command.recovery
    if command.approval is None or command.approver is None or step is None:
        return refused("not_authorised")
    if state is None or state.failure is None:
        return refused("no_failure", because("nothing_to_recover", node_id=plan.node_id))
    if mission.status != "awaiting_human" or mission.handoff_id != command.approval:
        return refused("not_active", because("nothing_planned_now", status=mission.status))
    if mission.invocation is not None:
        return refused("in_flight", node_id=mission.invocation.intent.node_id)
    broken = beyond(mission, command) or revision_refusal(mission, plan.contract, reopened=plan.reopened)
    if broken:
        return broken
    paid = _paid_plan(mission, command, plan, step=step)
    ahead = reduce(apply, paid, mission)
    start = replace(command, plan=None, recovery=None)
    refusal = unready(ahead, start) or misbound(ahead, start)
    return refusal or Accepted((*paid, replace(command.intent, k_ctx=ahead.k)))


def revised_ahead(mission: Mission, plan: RevisedPlan, step: RecoveryProposal) -> Mission:
    """The mission as it would be on an approved plan, before its first start."""
    return apply(mission, _graph(mission, plan, step))


def _paid_plan(
    mission: Mission, command: AuthoriseDispatch, plan: RevisedPlan, *, step: RecoveryProposal
) -> tuple[MissionEvent, ...]:
    state, approval, approver = mission.of(plan.node_id), command.approval, command.approver
    assert approval is not None
    assert approver is not None
    answered = HandoffAnswered(handoff_id=approval, decision="approved", actor=approver, reason=command.reason)
    context = command.recovery_context or command.intent.context
    paid = spend(state, step, attempt=state.attempt + 1, context=context, until_s=None)
    chosen = replace(paid, signature=command.signature, handoff_id=approval)
    return answered, accounted(mission, chosen), _graph(mission, plan, step)


def _graph(mission: Mission, plan: RevisedPlan, step: RecoveryProposal) -> GraphRevised:
    left = left_now(mission, plan.node_id)
    return GraphRevised(
        revision=mission.graph_revision + 1,
        cause="recovery",
        responsible=plan.node_id,
        reopened=plan.reopened,
        reason=plan.reason,
        failure=step.failure,
        contract=plan.contract,
        proposed_by=plan.planner,
        left_node=max(0, left[0] - step.cost),
        left_mission=max(0, left[1] - step.cost),
    )


def pass_over(mission: Mission, command: PassOverStep) -> Decision[MissionEvent]:
    """A step that can change nothing here counts as tried, at its cost: the ladder goes on with the next one."""
    if mission.status != "active":
        return refused("not_active", because("nothing_planned_now", status=mission.status))
    if mission.invocation is not None:
        return refused("in_flight", node_id=mission.invocation.intent.node_id)
    state, proposal = mission.nodes.get(command.node_id), command.proposal
    if state is None or state.failure is None:
        return refused("no_failure", because("nothing_to_recover", node_id=command.node_id))
    if proposal.action not in REPLANNING:
        return refused("step_applies", action=proposal.action)
    broken = first_broken_recovery(
        mission,
        node_id=command.node_id,
        proposal=proposal,
        signature=command.signature,
        policy=required_policy(mission),
    )
    if broken:
        return broken
    paid = spend(state, proposal, attempt=state.attempt, context=command.context, until_s=None)
    charge = accounted(mission, replace(paid, signature=command.signature))
    stands = FailureClassified(
        node_id=command.node_id,
        invocation_id=None,
        failure=state.failure.failure,
        reason=command.reason,
        at_s=command.at_s,
    )
    return Accepted((charge, stands))


def _unpaid(mission: Mission, command: ReviseContract) -> Refused | None:
    """With an open failure a plan is a recovery step like any other; without one it still costs a local_replan."""
    state = mission.of(command.node_id)
    if state.failure is None:
        why = over_budget(mission, command.node_id, "local_replan")
        return refused(why.code, because("plan_unpaid", why=why)) if why else None
    failure = state.failure.failure
    return first_broken_recovery(
        mission,
        node_id=command.node_id,
        proposal=RecoveryProposal(
            action="local_replan", failure=failure, provider_id=None, cost=1, reason=command.reason
        ),
        signature=Signature(
            action="local_replan",
            provider_id=ProviderId(command.planner),
            provider_version="",
            parameters=digest(command.contract),
            failure=failure,
        ),
        policy=required_policy(mission),
    )


def tighten(mission: Mission, command: TightenConstraints) -> Decision[MissionEvent]:
    """The tightest of both from now on. A restriction that is already met changes nothing."""
    current = required_contract(mission).constraints
    try:
        both = tightest(current, command.constraints)
    except ContractInvalid as error:
        return refused("nothing_allowed", because("limits_exclude_all", why=error.reason))
    if both == tightest(current, current):
        return Accepted(())
    return Accepted((ConstraintsTightened(layer=command.layer, reason=command.reason, constraints=both),))


def dispute(mission: Mission, command: DisputeCompletion) -> Decision[MissionEvent]:
    """An accepted fact and those that depend on it are marked; it counts as a false completion (D21)."""
    fact = next((one for one in mission.facts if one.condition_id == command.condition_id), None)
    if fact is None:
        accepted = tuple(one.condition_id for one in mission.facts)
        if not accepted:
            return refused("no_such_fact", because("no_fact_accepted", condition_id=command.condition_id))
        return refused("no_such_fact", condition_id=command.condition_id, accepted=accepted)
    if any(one.root and (one.condition_id, one.packet_id) == (fact.condition_id, fact.packet_id)
           for one in mission.disputes):  # fmt: skip
        return Accepted(())
    building = descendants(required_contract(mission), fact.node_id)
    disputed = CompletionDisputed(
        condition_id=fact.condition_id,
        packet_id=fact.packet_id,
        node_id=fact.node_id,
        actor=command.actor,
        reason=command.reason,
        dependents=tuple(one.condition_id for one in mission.facts if one.node_id in building),
    )
    return Accepted((disputed,))


def descendants(contract: TaskContract, node_id: NodeId) -> frozenset[NodeId]:
    """The stages that depend on this one, directly or not."""
    found: set[NodeId] = set()
    for name in order(contract):
        if set(contract.node(name).depends_on) & {node_id, *found}:
            found.add(name)
    return frozenset(found)
