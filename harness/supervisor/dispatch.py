"""Starts providers, the only way to do so: plan, route, compile C2, record intent with leases, then send (R78, R79)."""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from harness.contexts.planner import planner_context
from harness.contexts.skill import skill_context
from harness.contexts.view import StateView
from harness.contracts import commands, ids
from harness.contracts.any_events import AnyEvent
from harness.contracts.capabilities import Capability, CapabilityCard
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.control import CONTROL, RequireNoTeleoperation
from harness.contracts.decisions import Accepted, Refused, refused
from harness.contracts.events import DispatchIntended, NodePlanned
from harness.contracts.evidence import EvidenceReference
from harness.contracts.handoff_commands import ReturnControl
from harness.contracts.models import ModelAdvice, ModelUse
from harness.contracts.ports import Record
from harness.contracts.proposals import PlanProposal, RecoveryProposal, Signature, SkillProposal
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import Explanation, Reason, because, several
from harness.contracts.revision_commands import RecordAttestation, RevisedPlan
from harness.contracts.tasks import Node, TaskContract
from harness.contracts.values import digest, raw
from harness.gate.commit import CommandEnvelope
from harness.gate.dispatch import spend
from harness.gate.revisions import revised_ahead
from harness.planning.planner import Plan, planned
from harness.planning.skill import LOOK_S, propose_skill
from harness.projections.mission import Mission, NodeState, required_contract
from harness.projections.mission_fold import apply
from harness.recovery.state import VERIFY_ONLY
from harness.routing.question import RoutingQuestion
from harness.routing.requirements import ProviderRequirements
from harness.supervisor.estimates import TargetScores
from harness.supervisor.leases import acquire, tokens
from harness.supervisor.roles import RoleContexts, context_record, record
from harness.verification.preconditions import verify_preconditions

OBSERVING_TIMEOUT_S = 30.0
OBSERVE: tuple[Capability, ...] = ("observe",)
LOOK: Parameters = {"duration_s": LOOK_S, "frames": 1.0}


@dataclass(frozen=True)
class Approval:
    """A person's answer that opens one dispatch in the same transaction: an approval (D28), an attestation (D17), or a
    hand-back of the robot."""

    handoff_id: ids.HandoffId
    command: commands.ApproveHandoff | commands.AttestHandoff | ReturnControl
    attestation: RecordAttestation | None = None


@dataclass(frozen=True)
class DispatchAttempt:
    """One request to dispatch a node: the first attempt, or a recovery step that C4 proposed or a person chose.

    A person may also have it wait, drive slower than the contract allows, or be the first on another `plan`; `aside`
    is the place that such a plan waits at, and for how many seconds.
    """

    node_id: ids.NodeId
    recovery: RecoveryProposal | None = None
    c4: Context | None = None
    approval: Approval | None = None
    plan: RevisedPlan | None = None
    wait_s: float = 0.0
    speed_cap_mps: float | None = None
    aside: tuple[ids.PlaceId, float] | None = None

    @property
    def verify_only(self) -> bool:
        return self.plan is None and self.recovery is not None and self.recovery.action in VERIFY_ONLY


@dataclass(frozen=True)
class PreparedDispatch:
    """An invocation as it would run: the intent, and the records of how it was chosen."""

    intent: DispatchIntended
    candidates: ids.Digest
    records: tuple[Record, ...]


@dataclass(frozen=True)
class PreconditionBlocked:
    """A precondition that does not hold now."""

    name: str
    reason: Explanation


class Dispatcher:
    """Builds intents and hands them to the gate; nothing is sent before the intent is durable."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection
        self._estimates = TargetScores(roles)

    def next_node(self, mission: Mission) -> tuple[Plan, Context]:
        """The next node, and the C1 it was planned from; the harness admits the planner's proposal or uses its own."""
        view = self._roles.view(mission)
        c1 = planner_context(replace(view, estimates=self._estimates.records(view)))
        plan = planned(self._connection.planner, c1, mission=mission)
        if plan.use is not None:
            self._record(mission, plan, plan.use)
        return plan, c1

    def _record(self, mission: Mission, plan: Plan, use: ModelUse) -> None:
        """What the model said as the planner, followed or not."""
        named = plan.proposal.node_id if plan.proposal else None
        advice = ModelAdvice(
            role="planner",
            node_id=named if named in mission.nodes else None,
            said=_words(plan.proposal),
            action=(named or "")[:200],
            refused=plan.refused,
            use=use,
        )
        self._runtime.submit(mission.mission_id, commands.RecordAdvice(advice=advice))

    def blocked(self, mission: Mission, node_id: ids.NodeId) -> PreconditionBlocked | None:
        """The first precondition that does not hold now, tested again at every dispatch (R18)."""
        unusable = self.unusable()
        if unusable is not None:
            return unusable
        view = self._roles.view(mission)
        node = required_contract(mission).node(node_id)
        results = verify_preconditions(
            node, status=view.status, recent=view.recent, facts=mission.facts, at_s=view.at_s, rules=view.rules
        )
        broken = next((result for result in results if result.verdict != "satisfied"), None)
        return (
            PreconditionBlocked(
                broken.condition_id, because("precondition_fails", condition=broken.text, reason=broken.reason)
            )
            if broken
            else None
        )

    def unusable(self) -> PreconditionBlocked | None:
        """Why nothing is started on the robot at this address: its answers cannot be used, or it is another one."""
        trouble = self._roles.observations.trouble
        return PreconditionBlocked("robot_answers", trouble) if trouble is not None else None

    def refuse(self, mission: Mission, node_id: ids.NodeId, blocked: PreconditionBlocked) -> None:
        self._runtime.submit(
            mission.mission_id,
            commands.RefusePrecondition(
                node_id=node_id,
                precondition=blocked.name,
                reason=blocked.reason,
                at_s=self._connection.clock.now().mission_s,
            ),
        )

    def dispatch(
        self, mission: Mission, attempt: DispatchAttempt, *, plan: tuple[Plan, Context] | None = None
    ) -> Accepted[AnyEvent] | Refused:
        """Prepare and commit one invocation. Refused leaves nothing behind but a failure."""
        prepared = self.prepare(mission, attempt, intention=plan[0] if plan else None)
        if isinstance(prepared, Refused):
            return self._fail(mission, attempt, "provider_unavailable", prepared.reason)
        return self.commit(mission, attempt, prepared, plan=plan)

    def commit(
        self,
        mission: Mission,
        attempt: DispatchAttempt,
        prepared: PreparedDispatch,
        *,
        plan: tuple[Plan, Context] | None = None,
    ) -> Accepted[AnyEvent] | Refused:
        """Commit one invocation as prepared, with what authorises it."""
        command = self._command(attempt, prepared, plan)
        records = [record("plan", plan[0].proposal)] if plan and plan[0].proposal else []
        contexts = [context_record(one) for one in (plan[1] if plan else None, attempt.c4) if one is not None]
        decision = self._commit(mission, attempt, command, records=(*prepared.records, *contexts, *records))
        if isinstance(decision, Refused) and decision.rule in ("lease_held", "lease_quarantined", "stale_token"):
            return self._fail(mission, attempt, "resource_conflict", decision.reason)
        return decision

    def taken(self, mission: Mission, node_id: ids.NodeId) -> Reason | None:
        """Which resource of this node somebody still holds, and why; None if all of them are free."""
        node = required_contract(mission).node(node_id)
        cards = [card for card in self._connection.cards if card.capability in node.capabilities]
        resources = dict.fromkeys((*node.resources, *(one for card in cards for one in card.resources)))
        leases = [self._runtime.lease(ids.leased(mission.robot_id, one)) for one in resources]
        held = [lease for lease in leases if lease.status != "free"]
        return several(
            [
                because("resource_taken", resource=one.resource, status=one.status, invocation_id=one.invocation_id)
                for one in held
            ]
        )

    def prepare(
        self, mission: Mission, attempt: DispatchAttempt, *, intention: Plan | None = None
    ) -> PreparedDispatch | Refused:
        """Route and compile C2 to exactly what would run; nothing is written. C2 is shown the planner's intention."""
        ahead = self._ahead(mission, attempt)
        view = self._roles.view(ahead)
        question = self._question(view, attempt)
        chosen = question.answer()
        if chosen.chosen is None:
            why = tuple(
                because("provider_filtered", provider_id=one.provider_id, filter=one.refused_by, reason=one.reason)
                for one in chosen.candidates
            )
            return refused("provider_unavailable", because("nobody_can_serve", node_id=attempt.node_id, why=why))
        card = self._connection.provider(chosen.chosen).card
        planned = ahead if attempt.plan else mission
        examples = self._roles.examples(planned, attempt.node_id, card)
        intentions = (_intention(intention, attempt.node_id, at_s=view.at_s),) if intention else ()
        skill_view = replace(view, mission=_limited(ahead, attempt), examples=examples, proposals=intentions)
        c2 = skill_context(skill_view, attempt.node_id, card)
        skill = propose_skill(c2)
        question_record, answered = record("question", question), record("candidates", chosen)
        intent = replace(
            self._intent(planned, attempt, card=card, skill=skill, c2=c2),
            question=question_record.digest,
            candidates=answered.digest,
        )
        records = (context_record(c2), question_record, answered, record("skill", skill))
        return PreparedDispatch(intent=intent, candidates=answered.digest, records=records)

    def _ahead(self, mission: Mission, attempt: DispatchAttempt) -> Mission:
        """The state version the invocation will be bound to: after the spend that pays for it (D9)."""
        if attempt.recovery is None or attempt.c4 is None:
            return mission
        node = mission.of(attempt.plan.node_id if attempt.plan else attempt.node_id)
        paid = spend(node, attempt.recovery, attempt=node.attempt + 1, context=attempt.c4.digest, until_s=None)
        after = apply(mission, paid)
        return revised_ahead(after, attempt.plan, attempt.recovery) if attempt.plan else after

    def _question(self, view: StateView, attempt: DispatchAttempt) -> RoutingQuestion:
        mission, node = view.mission, view.node(attempt.node_id)
        state = mission.of(attempt.node_id)
        cards: Sequence[CapabilityCard] = self._connection.cards
        if attempt.recovery is not None and attempt.recovery.provider_id is not None:
            cards = [card for card in cards if card.provider_id == attempt.recovery.provider_id]
        capabilities = OBSERVE if attempt.verify_only else node.capabilities
        able = [card for card in cards if card.capability in capabilities]
        need = ProviderRequirements(
            node=node,
            capabilities=capabilities,
            parameters=LOOK if attempt.verify_only else node.parameters,
            embodiment=self._connection.embodiment,
            k=mission.k,
            at_s=view.at_s,
            map_version=view.contract.map_version,
            configuration=mission.configuration,
            status=view.status,
            minimum_charge=view.contract.constraints.minimum_charge,
            excluded=() if attempt.verify_only else state.excluded,
            vetoes=mission.vetoes,
            place=self._roles.place(mission, attempt.node_id),
            history=self._roles.history(mission, attempt.node_id, able),
        )
        preferences = self._runtime.configuration_of(mission).routing
        return RoutingQuestion(need=need, cards=tuple(cards), preferences=preferences)

    def _intent(
        self, mission: Mission, attempt: DispatchAttempt, *, card: CapabilityCard, skill: SkillProposal, c2: Context
    ) -> DispatchIntended:
        node, number = required_contract(mission).node(attempt.node_id), mission.of(attempt.node_id).attempt + 1
        request = ids.request_id(mission.mission_id, attempt.node_id, number)
        now_s = self._connection.clock.now().mission_s
        begins_s = now_s + attempt.wait_s
        timeout_s = min(node.timeout_s, OBSERVING_TIMEOUT_S) if attempt.verify_only else node.timeout_s
        images = skill.parameters.get("images", ())
        cites = tuple(packet.identity.packet_id for packet in mission.of(attempt.node_id).packets)
        return DispatchIntended(
            node_id=attempt.node_id,
            attempt=number,
            request_id=request,
            invocation_id=ids.invocation_id(request),
            provider_id=card.provider_id,
            provider_version=card.version,
            capability=card.capability,
            parameters=skill.parameters,
            resources=tokens(self._runtime, mission.robot_id, card.resources),
            k_ctx=mission.k,
            deadline_s=begins_s + timeout_s,
            dispatched_s=now_s,
            context=c2.digest,
            before=self._before(node, attempt),
            blobs=tuple(d for d in images if isinstance(d, str)) if isinstance(images, tuple) else (),  # type: ignore[misc]
            verify_only=attempt.verify_only,
            cites=cites,
            action=_action(mission, attempt, number=number),
            handoff_id=attempt.approval.handoff_id if attempt.approval else None,
            moves=card.moves,
            not_before_s=begins_s if attempt.wait_s else None,
        )

    def _before(self, node: Node, attempt: DispatchAttempt) -> tuple[EvidenceReference, ...]:
        """O_before: the samples of the last seconds, for nodes whose policy requires pose evidence."""
        if attempt.verify_only or "trajectory" not in node.evidence.mandatory:
            return ()
        reference, _ = self._roles.observations.seal(self._roles.observations.recent, source="robot")
        return (replace(reference, kind="before"),)

    def _command(
        self, attempt: DispatchAttempt, prepared: PreparedDispatch, plan: tuple[Plan, Context] | None
    ) -> commands.AuthoriseDispatch:
        approval, intent = attempt.approval, prepared.intent
        return commands.AuthoriseDispatch(
            intent=intent,
            planned=_planned(prepared, *plan) if plan else None,
            recovery=attempt.recovery,
            signature=_signature(attempt, intent),
            recovery_context=attempt.c4.digest if attempt.c4 else None,
            approval=approval.handoff_id if approval and approval.attestation is None else None,
            approver=approval.command.actor if approval else None,
            attestation=approval.attestation if approval else None,
            handed_back=approval is not None and isinstance(approval.command, ReturnControl),
            reason=approval.command.reason if approval else "",
            plan=attempt.plan,
        )

    def _commit(
        self,
        mission: Mission,
        attempt: DispatchAttempt,
        command: commands.AuthoriseDispatch,
        *,
        records: Sequence[Record],
    ) -> Accepted[AnyEvent] | Refused:
        """The intent, its leases and the approval that pays for it: all or none."""
        requests = [
            CommandEnvelope(ids.mission_stream(mission.mission_id), command, mission.robot_id),
            *acquire(mission, command.intent),
        ]
        if attempt.approval is not None:
            requests.insert(
                0,
                CommandEnvelope(
                    ids.handoff_stream(attempt.approval.handoff_id), attempt.approval.command, mission.robot_id
                ),
            )
        if command.handed_back:
            requests.insert(
                0, CommandEnvelope(CONTROL, RequireNoTeleoperation(robot_id=mission.robot_id), mission.robot_id)
            )
        return self._runtime.commit(requests, records=records)

    def _fail(self, mission: Mission, attempt: DispatchAttempt, failure: FailureClass, reason: Reason) -> Refused:
        if attempt.approval is None and mission.of(attempt.node_id).failure is None:
            command = commands.ReportFailure(
                node_id=attempt.node_id,
                invocation_id=None,
                failure=failure,
                reason=reason,
                at_s=self._connection.clock.now().mission_s,
            )
            self._runtime.submit(mission.mission_id, command)
        return Refused(failure, reason)


def _words(proposal: PlanProposal | None) -> str:
    """The model's own reason."""
    reason = proposal.reason if proposal else ""
    return str(reason.facts.get("text", ""))[:1000] if isinstance(reason, Reason) else reason[:1000]


def _intention(plan: Plan, node_id: ids.NodeId, *, at_s: float) -> ContextRecord:
    """Why the planner chose this stage: usable by the skill role, never evidence (R75)."""
    return ContextRecord(
        kind="intention",
        origin="planner",
        source=node_id,
        at_s=at_s,
        value=raw({"planner": plan.planner, "reason": plan.reason}),
    )


def _paid(node: NodeState, number: int) -> RecoveryAction | None:
    """The recovery step that a revision of the graph paid for, where this attempt is the one it leads to."""
    last = node.spends[-1] if node.spends else None
    return last.action if last is not None and last.signature is not None and last.attempt == number else None


def _planned(prepared: PreparedDispatch, plan: Plan, c1: Context) -> NodePlanned:
    return NodePlanned(
        node_id=prepared.intent.node_id,
        provider_id=prepared.intent.provider_id,
        context=c1.digest,
        candidates=prepared.candidates,
        reason=plan.reason,
        planner=plan.planner,
        proposal=digest(plan.proposal) if plan.proposal else None,
        refused=plan.refused,
    )


def _signature(attempt: DispatchAttempt, intent: DispatchIntended) -> Signature | None:
    recovery, plan = attempt.recovery, attempt.plan
    if recovery is None:
        return None
    return Signature(
        action=recovery.action,
        provider_id=ids.ProviderId(plan.planner if plan else intent.provider_id),
        provider_version=plan.planner if plan else intent.provider_version,
        parameters=digest(plan.contract if plan else intent.parameters),
        failure=recovery.failure,
    )


def _action(mission: Mission, attempt: DispatchAttempt, *, number: int) -> RecoveryAction | None:
    """The step that this invocation is: of another plan only its payer's own is, other stages begin on it."""
    recovery, plan = attempt.recovery, attempt.plan
    if recovery is None:
        return _paid(mission.of(attempt.node_id), number)
    return None if plan is not None and plan.node_id != attempt.node_id else recovery.action


def _limited(mission: Mission, attempt: DispatchAttempt) -> Mission:
    """The mission as the skill role is shown it: a lower speed that a person chose binds this invocation."""
    contract = required_contract(mission)
    speed_mps = min(attempt.speed_cap_mps or contract.constraints.speed_cap_mps, contract.constraints.speed_cap_mps)
    return replace(mission, contract=_with_speed(contract, speed_mps))


def _with_speed(contract: TaskContract, speed_mps: float) -> TaskContract:
    return replace(contract, constraints=replace(contract.constraints, speed_cap_mps=speed_mps))
