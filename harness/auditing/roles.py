"""Derives each role's output again from what it was shown, and compares it with what is stored.

Covers the C1 plan, routing, the C2 skill, C3 verdicts, C4 recovery, and the targets of an exploring mission.
"""

from collections.abc import Callable, Iterator
from typing import TypeVar

import msgspec

from harness.auditing.exploration import map_differences, new_choices, target_differences
from harness.auditing.outcomes import OutcomeLog
from harness.auditing.prose import same
from harness.contracts import events
from harness.contracts.contexts import Blobs, Context
from harness.contracts.errors import BlobGone, HarnessError
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import Predicates
from harness.contracts.proposals import CandidateSet, PlanProposal, RecoveryProposal
from harness.contracts.reasons import Explanation, Reason, because, parts, plain, several
from harness.contracts.revision_events import GraphRevised
from harness.contracts.values import decode, encode
from harness.contracts.verdicts import NodeVerdict
from harness.planning.planner import GRAPH_ORDER, plan, plan_refusal
from harness.planning.skill import propose_skill
from harness.projections.exploration import is_update, update_of
from harness.projections.mission import Mission
from harness.recovery.ladder import recover
from harness.routing.question import RoutingQuestion
from harness.runtime import Runtime
from harness.verification.finding import UNAVAILABLE
from harness.verification.verdict import verify, verify_goal

T = TypeVar("T")
ROLES = ("plans", "routings", "skills", "verdicts", "recoveries", "goals", "targets", "maps")


class Differs(Exception):
    """What was derived again is not what is stored; `reason` says how."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(plain(reason))
        self.reason = reason


class RoleReplay:
    """Derives again what each event says a role decided. `derived` counts the results by kind.

    `outcomes`: the log that the sums which routing was told are folded from; None if it does not hold all missions.
    """

    def __init__(self, runtime: Runtime, *, outcomes: OutcomeLog | None) -> None:
        self._runtime = runtime
        self._outcomes = outcomes
        self.old = False
        self.derived = dict.fromkeys((*ROLES, "unanswered", "erased"), 0)
        self._gone = False

    def differences(self, mission: Mission, event: events.MissionEvent) -> Iterator[Reason]:
        """Differences of one event, derived on the mission as it was before it."""
        for check in self._checks(mission, event):
            try:
                check()
            except Differs as difference:
                yield difference.reason
            except HarnessError as error:
                yield because("audited_input_unreadable", reason=error.located)

    def _checks(self, mission: Mission, event: events.MissionEvent) -> tuple[Callable[[], None], ...]:
        match event:
            case events.NodePlanned():
                return (lambda: self._plan(mission, event),)
            case events.DispatchIntended():
                return (lambda: self._routing(mission, event), lambda: self._skill(event))
            case events.ContractCompiled():
                return (lambda: self._policy(mission.configuration, event),)
            case events.ContractRecompiled():
                return (lambda: self._policy(event.configuration, event),)
            case events.VerdictRecorded():
                return (lambda: self._verdict(event.verdict),)
            case events.GoalVerified():
                return (lambda: self._goal(event),)
            case events.RecoveryAuthorised():
                return (lambda: self._recovery(event),)
            case events.HandoffRequested() | events.NodeFailed():
                return (lambda: self._escalation(event),)
            case GraphRevised():
                return (lambda: self._targets(mission, event),)
            case events.ObservationRecorded():
                return (lambda: self._map(mission, event),)
            case _:
                return ()

    def _plan(self, mission: Mission, event: events.NodePlanned) -> None:
        c1 = self._stored(event.context, Context)
        own = plan(c1)
        if c1.k != mission.k:
            raise Differs(because("audited_plan_of_other_state", shown=c1.k, planned=mission.k))
        if event.planner == GRAPH_ORDER.name or event.refused:
            expected = (own.node_id, own.reason)
        else:
            recorded = self._stored(event.proposal, PlanProposal) if event.proposal else own
            if refused := plan_refusal(recorded, mission=mission):
                raise Differs(because("audited_plan_refused", reason=refused.reason))
            expected = (recorded.node_id, recorded.reason)
        self.derived["plans"] += 1
        if not same(expected, (event.node_id, event.reason), old=self.old):
            raise Differs(because("audited_plan_differs", stored=event.node_id, derived=expected[0]))

    def _policy(self, pinned: Digest, event: events.ContractCompiled | events.ContractRecompiled) -> None:
        if event.policy != self._runtime.stored_configuration(pinned).recovery:
            raise Differs(because("audited_policy_differs", configuration=pinned[:12]))

    def _routing(self, mission: Mission, event: events.DispatchIntended) -> None:
        if event.question is None or event.candidates is None:
            return
        stored = self._stored(event.candidates, CandidateSet)
        question = self._stored(event.question, RoutingQuestion)
        if question.preferences != self._runtime.configuration_of(mission).routing:
            raise Differs(because("audited_routing_preferences", configuration=mission.configuration[:12]))
        self._sums(question)
        again = question.answer()
        self.derived["routings"] += 1
        if not same(again, stored, old=self.old):
            raise Differs(because("audited_candidates_differ", stored=stored.chosen, derived=again.chosen))
        if again.chosen != event.provider_id:
            raise Differs(because("audited_provider_not_chosen", chosen=again.chosen, provider_id=event.provider_id))

    def _sums(self, question: RoutingQuestion) -> None:
        """What routing was told of each provider, folded again from the verdicts of the log."""
        if self._outcomes is None:
            return
        cards = {card.provider_id: card for card in question.cards}
        for setting in question.need.history.settings:
            again = self._outcomes.differs(
                setting, cards[setting.provider_id], half_life=question.preferences.history_half_life
            )
            if again is not None:
                raise Differs(
                    because(
                        "audited_outcomes_differ",
                        stored=str(setting.sums),
                        provider_id=setting.provider_id,
                        derived=str(again),
                    )
                )

    def _skill(self, event: events.DispatchIntended) -> None:
        again = propose_skill(self._stored(event.context, Context))
        self.derived["skills"] += 1
        if (again.provider_id, encode(again.parameters)) != (event.provider_id, encode(event.parameters)):
            raise Differs(because("audited_skill_differs", stored=str(event.parameters), derived=str(again.parameters)))

    def _verdict(self, stored: NodeVerdict) -> None:
        c3 = self._stored(stored.context, Context)
        again = self._judged(verify, c3)
        if stored.verifier == UNAVAILABLE != again.verifier:
            self.derived["unanswered"] += 1
            if stored.verdict != "ambiguous":
                raise Differs(because("audited_verdict_unanswered", stored=stored.verdict))
            return
        if self._unrepeatable(again, stored):
            return
        self.derived["verdicts"] += 1
        if not same(again, stored, old=self.old):
            raise Differs(because("audited_verdict_differs", stored=stored.verdict, derived=again.verdict))

    def _goal(self, event: events.GoalVerified) -> None:
        again = self._judged(verify_goal, self._stored(event.verdict.context, Context))
        if self._unrepeatable(again, event.verdict):
            return
        self.derived["goals"] += 1
        if not same(again, event.verdict, old=self.old):
            raise Differs(because("audited_goal_differs", stored=event.verdict.verdict, derived=again.verdict))

    def _judged(self, judge: Callable[[Context, Blobs, Predicates], T], context: Context) -> T:
        self._gone = False
        return judge(context, self._blob, self._runtime.predicates)

    def _blob(self, digest: Digest) -> bytes:
        try:
            return self._runtime.blob(digest)
        except BlobGone:
            self._gone = True
            raise

    def _unrepeatable(self, again: object, stored: object) -> bool:
        """Whether an erased blob was asked for and the answer is another one without it: then it says nothing."""
        unrepeatable = self._gone and not same(again, stored, old=self.old)
        self.derived["erased"] += unrepeatable
        return unrepeatable

    def _recovery(self, event: events.RecoveryAuthorised) -> None:
        """What C4 proposed; a step that a person chose at a handoff is theirs."""
        if event.handoff_id is not None:
            return
        again = recover(self._stored(event.context, Context))
        self.derived["recoveries"] += 1
        taken = (event.action, event.failure, event.cost, event.reason)
        if not same((again.action, again.failure, again.cost, again.reason), taken, old=self.old):
            raise Differs(
                because("audited_recovery_differs", stored=event.action, derived=again.action, reason=again.reason)
            )

    def _escalation(self, event: events.HandoffRequested | events.NodeFailed) -> None:
        """A person, or the end of a stage: C4 proposed it, or what C4 proposed was not possible."""
        if event.context is None:
            return
        again = recover(self._stored(event.context, Context))
        self.derived["recoveries"] += 1
        if _led_to(again, event.reason):
            return
        raise Differs(because("audited_person_differs", reason=event.reason, derived=again.action))

    def _targets(self, mission: Mission, event: GraphRevised) -> None:
        """Every target that a revision brings, proposed and admitted again."""
        for choice in new_choices(mission, event.contract).values() if event.contract else ():
            self.derived["targets"] += 1
            if found := several(target_differences(self._runtime, mission, choice, stored=self._stored)):
                raise Differs(found)

    def _map(self, mission: Mission, event: events.ObservationRecorded) -> None:
        if not is_update(event.reference):
            return
        self.derived["maps"] += 1
        if found := several(map_differences(self._runtime, mission, update_of(event.reference))):
            raise Differs(found)

    def _stored(self, name: Digest, kind: type[T]) -> T:
        """The record of that digest. Raises Differs if it was changed, UnknownName if it is missing."""
        body = self._runtime.record(name).body
        if sha256(body) != name:
            raise Differs(because("audited_record_changed", digest=name[:12], found=sha256(body)[:12]))
        try:
            return decode(body, kind)
        except msgspec.MsgspecError as error:
            raise Differs(
                because("audited_record_of_other_kind", digest=name[:12], kind=kind.__name__, error=str(error))
            ) from error


def _led_to(again: RecoveryProposal, stored: Explanation) -> bool:
    """Whether a proposal is why a person was asked, or names the action that was not possible."""
    if again.action == "human":
        return isinstance(stored, str) or any(one == again.reason for one in parts(stored))
    if isinstance(stored, str):
        return again.action in stored
    return any(one.facts.get("action") == again.action for one in parts(stored))
