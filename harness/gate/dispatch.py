"""Decides whether an invocation may start and what it costs; every actuation passes this check first (D9). Pure."""

from msgspec.structs import replace

from harness.contracts.commands import AuthoriseDispatch, AuthoriseWait
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.events import (
    DispatchIntended,
    HandoffAnswered,
    MissionEvent,
    OperatorRetryGranted,
    RecoveryAuthorised,
)
from harness.contracts.handoff_events import LONGEST_WAIT_S
from harness.contracts.ids import Digest, invocation_id, request_id
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import because
from harness.contracts.revision_events import AttestationRecorded
from harness.contracts.tasks import Node
from harness.gate.attestation import opened, unattested
from harness.gate.rules import standing_vetoes
from harness.projections.mission import (
    SETTLED,
    Mission,
    NodeState,
    eligible,
    failed,
    required_contract,
    required_policy,
)
from harness.recovery.approval import approval_required
from harness.recovery.rules import first_broken_recovery
from harness.recovery.state import VERIFY_ONLY, cost_of, left_now, over_budget


def authorise(mission: Mission, command: AuthoriseDispatch) -> Decision[MissionEvent]:
    """The spend, its k bump and the intent are one commit; the intent's `k_ctx` is the k after it."""
    refusal = (
        unready(mission, command)
        or misbound(mission, command)
        or unattested(mission, command)
        or _unpaid(mission, command)
    )
    if refusal:
        return refusal
    paid = _payment(mission, command)
    k = mission.k + sum(_bumps(event) for event in paid)
    planned: tuple[MissionEvent, ...] = (command.planned,) if command.planned else ()
    return Accepted((*planned, *paid, replace(command.intent, k_ctx=k, aborting=_aborting(mission, command.intent))))


def _aborting(mission: Mission, intent: DispatchIntended) -> bool:
    """Whether this runs because a required stage failed: it then brings the body back and counts as no stage (D26)."""
    contract = required_contract(mission)
    node = contract.node(intent.node_id)
    waits_for = {dependency for dependency in node.depends_on if mission.of(dependency).status not in SETTLED}
    return node.runs_after_failure and failed(mission) and bool(waits_for)


def wait(mission: Mission, command: AuthoriseWait) -> Decision[MissionEvent]:
    """A free step without an invocation of its own. Waiting is bounded by the node's timeout (D24)."""
    node = mission.of(command.node_id)
    if node.failure is None:
        return refused("no_failure", because("nothing_to_answer", node_id=command.node_id))
    if command.proposal.cost or command.proposal.action in VERIFY_ONLY:
        return refused("not_waiting", because("needs_dispatch", action=command.proposal.action))
    broken = first_broken_recovery(
        mission, node_id=command.node_id, proposal=command.proposal, signature=None, policy=required_policy(mission)
    )
    if broken:
        return broken
    latest = node.failure.at_s + required_contract(mission).node(command.node_id).timeout_s
    until_s = min(command.until_s, latest)
    step = spend(node, command.proposal, attempt=node.attempt, context=command.context, until_s=until_s)
    return Accepted((accounted(mission, step),))


def unready(mission: Mission, command: AuthoriseDispatch) -> Refused | None:
    """Why nothing may start now, or not this stage."""
    intent = command.intent
    answered = command.attestation.handoff_id if command.attestation else command.approval
    waiting = mission.status == "awaiting_human" and answered == mission.handoff_id
    if mission.status != "active" and not waiting:
        return refused("not_active", because("mission_is", status=mission.status))
    invocation = mission.invocation
    given_up = invocation is not None and invocation.status == "outcome_unknown" and command.approval is not None
    if invocation is not None and not given_up:
        return refused(
            "invocation_open", because("invocation_still_open", invocation_id=invocation.intent.invocation_id)
        )
    if mission.vetoes:
        return refused("vetoed", vetoes=standing_vetoes(mission))
    node = mission.nodes.get(intent.node_id)
    if node is None:
        return refused("unknown_node", because("node_not_in_contract", node_id=intent.node_id))
    answering = node.failure is not None and (command.recovery is not None or answered is not None)
    if not answering and intent.node_id not in eligible(mission):
        return refused("not_eligible", because("node_waits", node_id=intent.node_id))
    return None


def misbound(mission: Mission, command: AuthoriseDispatch) -> Refused | None:
    """Why this intent is not one of this stage as the contract states it."""
    intent, node = command.intent, required_contract(mission).node(command.intent.node_id)
    if intent.request_id != request_id(mission.mission_id, intent.node_id, intent.attempt):
        return refused("wrong_request_id", because("request_id_not_of_node"))
    if intent.invocation_id != invocation_id(intent.request_id):
        return refused("wrong_invocation_id")
    if intent.attempt != mission.of(intent.node_id).attempt + 1:
        return refused("wrong_attempt", attempt=intent.attempt, last_attempt=mission.of(intent.node_id).attempt)
    if wrong := _wait(command):
        return wrong
    if intent.deadline_s > (intent.not_before_s or intent.dispatched_s) + node.timeout_s:
        return refused("deadline_too_late", timeout_s=node.timeout_s)
    if not intent.verify_only and intent.capability not in node.capabilities:
        return refused("wrong_capability", capability=intent.capability, node_id=intent.node_id)
    if intent.verify_only and intent.moves:
        return refused("verify_only_moves")
    if intent.verify_only != (command.recovery is not None and command.recovery.action in VERIFY_ONLY):
        return refused("wrong_kind")
    allowed = required_contract(mission).constraints.resources
    if beyond := sorted(set(intent.resources) - set(allowed)) if allowed else []:
        return refused("resource_not_allowed", resources=tuple(beyond))
    return _effect_changed(mission, intent, node)


def _wait(command: AuthoriseDispatch) -> Refused | None:
    """Only a person's approval may lie in front of its start, and only as long as the approval itself holds."""
    if command.intent.not_before_s is None:
        return None
    if command.approval is None:
        return refused("wait_unapproved")
    wait_s = command.intent.not_before_s - command.intent.dispatched_s
    return None if 0 < wait_s <= LONGEST_WAIT_S else refused("wait_too_long", wait_s=wait_s, limit_s=LONGEST_WAIT_S)


def _effect_changed(mission: Mission, intent: DispatchIntended, node: Node) -> Refused | None:
    changed = [
        name
        for name, value in node.parameters.items()
        if name in intent.parameters
        and not (intent.parameters[name] == value or bound_late(value))
        and not _slower(name, intent.parameters[name], value)
    ]
    if changed and not intent.verify_only:
        return refused("effect_changed", parameters=tuple(changed))
    speed, cap = intent.parameters.get("speed_cap_mps"), required_contract(mission).constraints.speed_cap_mps
    if isinstance(speed, float | int) and speed > cap:
        return refused("over_speed", speed_mps=speed, limit_mps=cap)
    return None


def _slower(name: str, requested: object, stated: object) -> bool:
    """Whether a speed cap is below the stated one: a restriction changes no effect."""
    numbers = isinstance(requested, int | float) and isinstance(stated, int | float)
    return name == "speed_cap_mps" and numbers and requested < stated  # type: ignore[operator]


def bound_late(value: object) -> bool:
    """Whether a node's parameter is read from committed facts at dispatch: `@{node.argument}`."""
    return isinstance(value, str) and value.startswith("@{")


def _unpaid(mission: Mission, command: AuthoriseDispatch) -> Refused | None:
    node, intent = mission.of(command.intent.node_id), command.intent
    if command.attestation is not None:
        return None
    if command.approval is not None:
        return beyond(mission, command)
    if command.recovery is not None:
        broken = first_broken_recovery(
            mission,
            node_id=intent.node_id,
            proposal=command.recovery,
            signature=command.signature,
            policy=required_policy(mission),
        )
        if broken:
            return broken
    elif not (node.fresh or waited(node)):
        return refused("not_authorised")
    needed = approval_required(
        mission=mission,
        node=required_contract(mission).node(intent.node_id),
        action=command.recovery.action if command.recovery else None,
        moves=intent.moves,
        share=required_policy(mission).approval_share,
    )
    return refused("approval_required", why=needed) if needed else None


def beyond(mission: Mission, command: AuthoriseDispatch) -> Refused | None:
    """A person may choose any action that the budget pays for, or one retry outside it; a hand-back only looks."""
    step, payer = command.recovery, command.plan.node_id if command.plan else command.intent.node_id
    if command.handed_back and (step is None or step.action != "verify_again"):
        return refused("not_a_look", because("hand_back_not_a_look"))
    if step is None or (step.action == "retry" and step.cost == 0):
        return None
    if step.cost != cost_of(step.action):
        return refused("wrong_cost", because("only_retry_is_free", action=step.action, cost=cost_of(step.action)))
    why = over_budget(mission, payer, step.action)
    return refused(why.code, because("action_unpaid", action=step.action, why=why)) if why else None


def waited(node: NodeState) -> bool:
    """Whether an authorised wait opened the next attempt: what kept the stage from working has ended (D24)."""
    last = node.spends[-1] if node.spends else None
    return last is not None and last.action == "wait" and last.attempt == node.attempt and node.failure is None


def _payment(mission: Mission, command: AuthoriseDispatch) -> tuple[MissionEvent, ...]:
    if command.attestation is not None:
        return opened(mission, command)
    events: list[MissionEvent] = []
    node = mission.of(command.intent.node_id)
    if command.approval is not None and command.approver is not None:
        answered = HandoffAnswered(
            handoff_id=command.approval,
            decision="handed_back" if command.handed_back else "approved",
            actor=command.approver,
            reason=command.reason,
        )
        events.append(answered)
    if command.recovery is None:
        return tuple(events)
    if command.approval is not None and command.recovery.cost == 0:
        granted = OperatorRetryGranted(
            node_id=node.node_id,
            attempt=command.intent.attempt,
            action=command.recovery.action,
            provider_id=command.intent.provider_id,
            handoff_id=command.approval,
        )
        return (*events, granted)
    paid = spend(
        node,
        command.recovery,
        attempt=command.intent.attempt,
        context=command.recovery_context or command.intent.context,
        until_s=None,
    )
    chosen = replace(paid, signature=command.signature, handoff_id=command.approval)
    return (*events, accounted(mission, chosen))


def spend(
    node: NodeState, proposal: RecoveryProposal, *, attempt: int, context: Digest, until_s: float | None
) -> RecoveryAuthorised:
    """The spend of one step: its cost, which providers it excludes, and until when it waits."""
    excluded = node.excluded
    if proposal.action == "switch_skill" and node.provider_id and node.provider_id not in excluded:
        excluded = (*excluded, node.provider_id)
    return RecoveryAuthorised(
        node_id=node.node_id,
        failure=proposal.failure,
        action=proposal.action,
        cost=proposal.cost,
        attempt=attempt,
        signature=None,
        excluded=excluded,
        context=context,
        reason=proposal.reason,
        until_s=until_s,
    )


def accounted(mission: Mission, step: RecoveryAuthorised) -> RecoveryAuthorised:
    """The step with both total budgets after it (R128)."""
    left_node, left_mission = left_now(mission, step.node_id)
    return replace(step, left_node=left_node - step.cost, left_mission=left_mission - step.cost)


def _bumps(event: MissionEvent) -> int:
    match event:
        case RecoveryAuthorised():
            return event.cost
        case HandoffAnswered(decision="approved" | "handed_back") | OperatorRetryGranted() | AttestationRecorded():
            return 1
        case _:
            return 0
