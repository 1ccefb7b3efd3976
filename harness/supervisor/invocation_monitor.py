"""Monitors the open invocation: starts it, keeps it alive, stops it, and turns its end into a packet and a verdict."""

from contextlib import suppress
from typing import Literal

from msgspec import UNSET, UnsetType

from harness.contracts import commands, protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContextOverflow, ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.events import DispatchIntended, NodeCommitted
from harness.contracts.ids import InvocationId, handoff_stream, mission_stream
from harness.contracts.observations import Image
from harness.contracts.reasons import Explanation, Reason, because
from harness.gate.commit import CommandEnvelope
from harness.projections.mission import Invocation, Mission, required_contract
from harness.runtime import Live
from harness.supervisor.approvals import after_wait, changed, clear_to_send, withdraw
from harness.supervisor.leases import HeldLeases, MotionIntent, give_back, holds
from harness.supervisor.measurements import IndependentMeasurements
from harness.supervisor.observations import image_reference
from harness.supervisor.packets import build_packet
from harness.supervisor.pictures import PictureExaminer
from harness.supervisor.roles import RoleContexts, context_record
from harness.supervisor.standstill import WINDOW_S
from harness.supervisor.verification import judgement

POLL_S = 0.5
SETTLE_S = 1.6
"""How long the body is watched after a terminal report before its packet is sealed."""
REST_WITHIN_S = 8.0
"""How much longer a body is watched for proof of standstill; without proof its lease is quarantined."""
UNREACHABLE_S = 20.0
"""How long an execution is asked for before its outcome is unknown, mission seconds."""
UNCLEAR_S = 2.0
"""How long answers may be unusable before a stop is sent: as long as a motion goes on without keepalives."""
ACKNOWLEDGE_S = 5.0
Effect = Literal["confirmed", "failed", "unknown"]
EFFECTS: dict[Effect, Reason] = {
    "confirmed": because("result_accepted"),
    "failed": because("result_not_accepted"),
    "unknown": because("result_unknown"),
}


class MissionMovedOn(Exception):
    """Another process or thread changed the mission since this turn began; the request was not sent."""


class InvocationMonitor:
    """Monitors one invocation at a time. Handles live in memory; the request id finds them again after a crash (D13).

    `found` is the invocation that an earlier process left open: its request may have been sent.
    """

    def __init__(self, roles: RoleContexts, *, found: Invocation | None) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection
        self._measurements = IndependentMeasurements(roles)
        self._pictures = PictureExaminer(roles)
        self._handles: dict[InvocationId, str] = {}
        self._sent = {found.intent.invocation_id} if found else set[InvocationId]()
        self._ended_since: float | None = None
        self._silent_since: float | None = None
        self._stopping_since: float | None = None
        self._resumed = False
        self._refused: tuple[InvocationId, float, Reason] | None = None
        self._doubted: set[InvocationId] = set()
        self._sent_s: dict[InvocationId, float] = {}

    def attend(self, mission: Mission, invocation: Invocation) -> float:
        """Check the invocation once; returns when to check again, in mission time."""
        now_s = self._connection.clock.now().mission_s
        try:
            return self._attended(mission, invocation, now_s)
        except MissionMovedOn:
            return now_s
        except ProviderUnreachable as error:
            return self._silence(mission, invocation, now_s, error.reason)
        except (ProviderFailed, UnknownName) as error:
            if invocation.intent.invocation_id not in self._sent:
                self._abandon(mission, invocation, failure="provider_unavailable", reason=error.reason)
                return now_s
            self._doubted.add(invocation.intent.invocation_id)
            return self._unclear(mission, invocation, now_s, error.reason)

    def _attended(self, mission: Mission, invocation: Invocation, now_s: float) -> float:
        intent, trouble = invocation.intent, self._roles.observations.trouble
        if intent.not_before_s is not None and now_s < intent.not_before_s and changed(mission, invocation) is None:
            return min(now_s + POLL_S, intent.not_before_s)
        refused = self._refused is not None and self._refused[0] == intent.invocation_id
        if not refused and self._lost(invocation):
            reason = because("provider_cannot_be_asked", provider_id=intent.provider_id)
            return self._silence(mission, invocation, now_s, reason, patience_s=0.0)
        if trouble is not None and intent.moves:
            return self._unclear(mission, invocation, now_s, trouble)
        report = None if refused else self._report(mission, invocation)
        if report is None:
            return self._refusal(mission, invocation, now_s)
        if isinstance(report, Refused):
            self._silent_since = None
            withdraw(self._runtime, self._connection, mission, intent=intent, reason=report.reason)
            return now_s
        unheard = self._roles.observations.unheard
        if unheard is not None and intent.moves and report.status not in protocol.TERMINAL:
            return self._unclear(mission, invocation, now_s, unheard)  # it reports, and nobody sees what it does
        self._publish(mission, report)
        if report.status in protocol.TERMINAL:
            self._silent_since = None
            return self._finish(mission, invocation, report, now_s)
        wake_s = self._supervise(mission, invocation, report, now_s)
        self._silent_since = None
        return wake_s

    def _lost(self, invocation: Invocation) -> bool:
        """Sent, perhaps, without a handle, to a provider that cannot be queried by request: never sent again (D13)."""
        intent = invocation.intent
        known = self._handles.get(intent.invocation_id) or invocation.handle
        askable = self._connection.provider(intent.provider_id).card.reattach == "by_request"
        return intent.invocation_id in self._sent and known is None and not askable

    def _report(self, mission: Mission, invocation: Invocation) -> protocol.InvocationReport | Refused | None:
        """The provider's report; reattach by handle, else by request id, else send the request (D13).

        Refused where its authorisation no longer holds: then nothing was sent. None where the provider refused it.
        Raises ProviderUnreachable if the answer is about another request, and where it may have begun unseen;
        MissionMovedOn where nothing was sent because another process changed the mission meanwhile.
        """
        intent = invocation.intent
        provider = self._connection.provider(intent.provider_id)
        handle = self._handles.get(intent.invocation_id) or invocation.handle
        askable = provider.card.reattach == "by_request"
        if handle is not None and not (askable and intent.invocation_id in self._doubted):
            return own(provider.report(handle), intent)
        known = provider.find(intent.request_id) if askable else None
        if known is not None:
            own(known, intent)
            if handle is None:
                self._roles.observations.catch_up(self._connection.spool.samples(intent.invocation_id))
            self._accepted(mission, intent, known)
            return known
        self._check_unsent(invocation)
        refused = after_wait(self._roles, mission, invocation)
        if refused is None:
            self._check_current(mission)
            refused = clear_to_send(self._runtime, mission, invocation)
        if refused is not None:
            return refused
        self._sent.add(intent.invocation_id)
        self._sent_s[intent.invocation_id] = self._connection.clock.now().mission_s
        try:
            request = _request(mission, intent, provider.card, deadline_s=self._deadline_s(intent))
            report = own(provider.start(request), intent)
        except ProviderUnreachable:
            raise
        except ProviderFailed as error:
            self._refused = (intent.invocation_id, self._connection.clock.now().mission_s, error.reason)
            return None
        self._accepted(mission, intent, report)
        return report

    def _check_current(self, mission: Mission) -> None:
        """The last look before a start: a stop, a veto or a pause that another process recorded comes first."""
        with self._runtime.turn():
            if self._runtime.mission(mission.mission_id).version != mission.version:
                raise MissionMovedOn

    def holds_motion(self, invocation: Invocation | None) -> bool:
        """Whether the robot's watchdog holds the execution, it is over, it moves nothing, or it never came."""
        if invocation is None or not invocation.intent.moves:
            return True
        report = self._known(invocation)
        if report is None:
            return invocation.intent.invocation_id not in self._sent
        return report.status in protocol.TERMINAL or report.failure == protocol.KEEPALIVE_LOST

    def halt(self, invocation: Invocation) -> None:
        """Tell the provider to stop the execution. The log says nothing of it: its outcome is read when it goes on."""
        handle = self._handles.get(invocation.intent.invocation_id) or invocation.handle
        with suppress(ProviderFailed, UnknownName):
            if handle is None:
                report = self._known(invocation)
                handle = report.handle if report is not None else None
            if handle is not None:
                self._connection.provider(invocation.intent.provider_id).stop(handle)

    def _known(self, invocation: Invocation) -> protocol.InvocationReport | None:
        """The provider's report on an execution; None where it knows of none, or does not answer."""
        provider = self._connection.provider(invocation.intent.provider_id)
        handle = self._handles.get(invocation.intent.invocation_id) or invocation.handle
        try:
            return provider.report(handle) if handle is not None else provider.find(invocation.intent.request_id)
        except ProviderFailed:
            return None

    def _check_unsent(self, invocation: Invocation) -> None:
        """Raises ProviderUnreachable where the request, which the provider does not find, may have been begun: it is
        never sent again then, and never called unsent."""
        intent = invocation.intent
        if intent.invocation_id in self._handles:
            raise ProviderUnreachable(because("request_forgotten", provider_id=intent.provider_id))
        if intent.invocation_id not in self._sent or not intent.moves:
            return
        if invocation.status == "outcome_unknown":
            raise ProviderUnreachable(because("result_unknown"))
        if self._has_begun(intent):
            raise ProviderUnreachable(because("started_but_not_found", provider_id=intent.provider_id))
        rest = self._roles.observations.rest()
        if not rest.static or invocation.stop_requested:
            raise ProviderUnreachable(because("body_moves_unaccounted"))

    def _has_begun(self, intent: DispatchIntended) -> bool:
        """Whether the robot's own journal holds a start of this request."""
        return any(start.request_id == intent.request_id for start in self._connection.robot.starts())

    def _starts(self, mission: Mission, intent: DispatchIntended) -> int | UnsetType:
        """How many starts of a motion the robot's own journal holds; a look asks about the motion that it looks at.

        Unset where nothing moved or nobody says.
        """
        request = intent.request_id if intent.moves else None
        if intent.verify_only:
            packets = mission.of(intent.node_id).packets
            moved = [one.identity.request_id for one in packets if not one.verify_only and one.begun is not UNSET]
            request = moved[-1] if moved else None
        if request is None or mission.replay:
            return UNSET
        try:
            return sum(start.request_id == request for start in self._connection.robot.starts())
        except (ProviderFailed, UnknownName):
            return UNSET

    def _refusal(self, mission: Mission, invocation: Invocation, now_s: float) -> float:
        """The provider refused the request. A motion that shows nevertheless is of unknown outcome, not refused."""
        assert self._refused is not None
        intent, (_, refused_s, reason) = invocation.intent, self._refused
        if not intent.moves:
            self._abandon(mission, invocation, failure="provider_unavailable", reason=reason)
            return now_s
        provider = self._connection.provider(intent.provider_id)
        known = provider.find(intent.request_id) if provider.card.reattach == "by_request" else None
        if known is not None or self._has_begun(intent):
            self._refused = None
            return now_s
        rest = self._roles.observations.rest()
        began = rest.reason is not None and rest.reason.code == "body_moved_in_second"
        if began and now_s >= refused_s + WINDOW_S:
            self._halt(invocation)
            self._abandon(mission, invocation, failure="outcome_unknown", reason=reason)
            return now_s
        if now_s < refused_s + SETTLE_S or (not rest.static and now_s < refused_s + SETTLE_S + REST_WITHIN_S):
            return now_s + POLL_S
        failure = "provider_unavailable" if rest.static else "outcome_unknown"
        self._abandon(mission, invocation, failure=failure, reason=reason)
        return now_s

    def _accepted(self, mission: Mission, intent: DispatchIntended, report: protocol.InvocationReport) -> None:
        before = self._handles.get(intent.invocation_id)
        self._handles[intent.invocation_id] = report.handle
        self._doubted.discard(intent.invocation_id)
        if before == report.handle:
            return
        self._resumed = False
        self._stopping_since = self._ended_since = None
        provider = self._connection.provider(intent.provider_id)
        if provider.card.reattach == "by_handle":
            self._runtime.submit(
                mission.mission_id, commands.AcceptInvocation(invocation_id=intent.invocation_id, handle=report.handle)
            )

    def _supervise(
        self, mission: Mission, invocation: Invocation, report: protocol.InvocationReport, now_s: float
    ) -> float:
        intent = invocation.intent
        provider = self._connection.provider(intent.provider_id)
        if invocation.stop_requested:
            self._stopping_since = now_s if self._stopping_since is None else self._stopping_since
            if now_s > self._stopping_since + provider.card.cancel.within_s + ACKNOWLEDGE_S:
                self._abandon(
                    mission, invocation, failure="cancel_unacknowledged", reason=because("cancel_not_acknowledged")
                )
                return now_s
            if report.status != "stopping":
                provider.stop(report.handle)
        elif now_s > self._deadline_s(intent):
            self._late(mission, invocation, now_s)
        elif report.failure == protocol.KEEPALIVE_LOST:
            self._reawaken(mission, invocation, report)
        else:
            self._resumed = False
        if intent.moves:
            provider.keepalive(report.handle)
        return now_s + POLL_S

    def _deadline_s(self, intent: DispatchIntended) -> float:
        """An act that moves nothing, and that nobody sent while no supervisor was there, has all its time from then."""
        sent_s = self._sent_s.get(intent.invocation_id)
        if sent_s is None or intent.moves:
            return intent.deadline_s
        lasts_s = intent.deadline_s - (intent.not_before_s or intent.dispatched_s)
        return max(intent.deadline_s, sent_s + lasts_s)

    def _late(self, mission: Mission, invocation: Invocation, now_s: float) -> None:
        """The deadline passed: a timeout is a failure of its own; C4's first step is to stop."""
        if mission.of(invocation.intent.node_id).failure is None:
            late = commands.ReportFailure(
                node_id=invocation.intent.node_id,
                invocation_id=invocation.intent.invocation_id,
                failure="timeout",
                reason=because("deadline_was_passed", late_s=now_s - invocation.intent.deadline_s),
                at_s=now_s,
            )
            self._runtime.submit(mission.mission_id, late)

    def _reawaken(self, mission: Mission, invocation: Invocation, report: protocol.InvocationReport) -> None:
        """The heartbeat watchdog stopped the robot: resume where card and leases allow, else stop (D12)."""
        intent = invocation.intent
        provider = self._connection.provider(intent.provider_id)
        if not holds(self._runtime, self._connection.robot_id, intent):
            self.stop(mission, invocation, reason=because("lease_was_quarantined"))
        elif provider.card.resumable and not self._resumed:
            self._runtime.submit(mission.mission_id, commands.ResumeInvocation(invocation_id=intent.invocation_id))
            provider.resume(report.handle)
            self._resumed = True
        elif not provider.card.resumable:
            self.stop(mission, invocation, reason=because("provider_cannot_resume"))

    def stop(self, mission: Mission, invocation: Invocation, *, reason: Explanation) -> None:
        """Ask for a stop; the invocation stays open until the provider acknowledges it."""
        self._runtime.submit(
            mission.mission_id, commands.StopInvocation(invocation_id=invocation.intent.invocation_id, reason=reason)
        )

    def _finish(
        self, mission: Mission, invocation: Invocation, report: protocol.InvocationReport, now_s: float
    ) -> float:
        """Seal the evidence once the body was observed long enough, judge it, and let the gate decide: one commit."""
        intent = invocation.intent
        self._ended_since = now_s if self._ended_since is None else self._ended_since
        ended_s = min(report.at_s, self._ended_since)
        needs_watch = intent.moves or intent.verify_only
        if needs_watch and now_s < ended_s + SETTLE_S:
            return min(now_s + POLL_S, ended_s + SETTLE_S)
        rest = self._roles.observations.rest()
        if intent.moves and not rest.static and now_s < ended_s + SETTLE_S + REST_WITHIN_S:
            return now_s + POLL_S
        until_s = report.at_s if mission.replay else now_s
        samples = [one for one in self._connection.spool.samples(intent.invocation_id) if one.at_s <= until_s]
        card = self._connection.provider(intent.provider_id).card
        self._roles.observations.fetch_rest(report.receipts)
        images = [image_reference(one) for one in samples if isinstance(one, Image)]
        packet = build_packet(
            mission,
            invocation,
            report=report,
            samples=samples,
            observations=self._roles.observations,
            collected_s=until_s,
            protocol=protocol.version_of(card.protocol),
            images=self._pictures.examined(mission, images),
            measured=self._measurements.of_invocation(mission, invocation, report=report, until_s=until_s),
            starts=self._starts(mission, intent),
        )
        try:
            c3, verdict = judgement(self._roles, mission, packet, card=card)
        except ContextOverflow as error:
            self._abandon(mission, invocation, failure="verifier_unavailable", reason=error.reason)
            return now_s
        requests = [
            CommandEnvelope(
                mission_stream(mission.mission_id),
                commands.CompleteNode(packet=packet, verdict=verdict),
                mission.robot_id,
            ),
            *give_back(
                self._runtime,
                HeldLeases(self._connection.robot_id, intent),
                at_rest=rest.static,
                reason=because(
                    "ended_at_rest", status=report.status, rest=rest.reason or because("at_rest_by_odometry")
                ),
            ),
        ]
        decision = self._runtime.commit(requests, records=[context_record(c3)])
        if isinstance(decision, Accepted):
            committed = any(isinstance(event, NodeCommitted) for event in decision.events)
            self._close(intent, "confirmed" if committed else "failed")
        return now_s

    def _close(self, intent: DispatchIntended, effect: Effect) -> None:
        """Record what is known of the end; an execution that may be found again keeps its samples."""
        if effect != "unknown":
            self._connection.spool.drop(intent.invocation_id)
            self._handles.pop(intent.invocation_id, None)
        self._stopping_since = self._ended_since = None
        if intent.handoff_id is not None:
            command = commands.RecordEffect(outcome=effect, reason=EFFECTS[effect])
            self._runtime.commit(
                [CommandEnvelope(handoff_stream(intent.handoff_id), command, self._connection.robot_id)]
            )

    def _unclear(self, mission: Mission, invocation: Invocation, now_s: float, reason: Reason) -> float:
        """What the robot answers cannot be used: after a while it is told to stop, and its outcome becomes unknown."""
        since = self._silent_since if self._silent_since is not None else now_s
        late = now_s - since >= UNCLEAR_S or self._roles.observations.stranger
        if late and invocation.status != "outcome_unknown":
            self._halt(invocation)
            if not invocation.stop_requested:
                self.stop(mission, invocation, reason=because("stopped_as_unclear", reason=reason))
        return self._silence(mission, invocation, now_s, reason)

    def _halt(self, invocation: Invocation) -> None:
        """Tell the provider to stop, whatever is known of the execution; what it answers decides nothing."""
        intent = invocation.intent
        provider = self._connection.provider(intent.provider_id)
        handle = self._handles.get(intent.invocation_id) or invocation.handle
        try:
            if handle is None and provider.card.reattach == "by_request":
                known = provider.find(intent.request_id)
                handle = known.handle if known is not None and known.status not in protocol.TERMINAL else None
            if handle is not None:
                provider.stop(handle)
        except (ProviderFailed, UnknownName):
            return

    def _silence(
        self,
        mission: Mission,
        invocation: Invocation,
        now_s: float,
        reason: Explanation,
        *,
        patience_s: float = UNREACHABLE_S,
    ) -> float:
        """No answer: ask again for a while; then the outcome is unknown and the resource is quarantined."""
        self._silent_since = self._silent_since if self._silent_since is not None else now_s
        if now_s - self._silent_since >= patience_s and invocation.status != "outcome_unknown":
            if patience_s:
                self._halt(invocation)
            self._abandon(mission, invocation, failure="outcome_unknown", reason=reason)
        return now_s + POLL_S

    def _abandon(self, mission: Mission, invocation: Invocation, *, failure: str, reason: Explanation) -> None:
        """End without a packet; a body that may move keeps its lease in quarantine."""
        self._refused = None
        intent = invocation.intent
        unknown = failure == "outcome_unknown"
        rest = self._roles.observations.rest()
        ended = commands.EndInvocation(
            invocation_id=intent.invocation_id,
            status="outcome_unknown" if unknown else "stopping" if failure == "cancel_unacknowledged" else "failed",
            failure=failure,
            reason=reason,
            at_s=self._connection.clock.now().mission_s,
        )
        is_over = rest.static and failure in ("provider_unavailable", "verifier_unavailable")
        self._runtime.commit(
            [
                CommandEnvelope(mission_stream(mission.mission_id), ended, mission.robot_id),
                *give_back(
                    self._runtime, HeldLeases(self._connection.robot_id, intent), at_rest=is_over, reason=reason
                ),
            ]
        )
        self._close(intent, "unknown" if unknown else "failed")

    def _publish(self, mission: Mission, report: protocol.InvocationReport) -> None:
        live = Live(
            mission_id=mission.mission_id,
            at_s=self._connection.clock.now().mission_s,
            report=report,
            status=self._roles.observations.status,
            samples=self._roles.observations.recent,
        )
        self._runtime.publish(live)


def own(report: protocol.InvocationReport, intent: MotionIntent) -> protocol.InvocationReport:
    """The report, if it is about this request. Raises ProviderUnreachable otherwise."""
    if report.identity.request_id != intent.request_id:
        raise ProviderUnreachable(
            because(
                "report_of_other_request", provider_id=intent.provider_id, request_id=report.identity.request_id[:12]
            ),
            where=because("at_invocation", invocation_id=intent.invocation_id),
        )
    return report


def _request(
    mission: Mission, intent: DispatchIntended, card: CapabilityCard, *, deadline_s: float
) -> protocol.StartRequest:
    """The request as it is sent; only a provider whose protocol knows of proposals is told the intended effects."""
    identity = protocol.InvocationIdentity(
        mission_id=mission.mission_id,
        node_id=intent.node_id,
        attempt=intent.attempt,
        request_id=intent.request_id,
        provider_id=intent.provider_id,
    )
    return protocol.StartRequest(
        identity=identity,
        capability=intent.capability,
        parameters=intent.parameters,
        k_ctx=intent.k_ctx,
        configuration=mission.configuration,
        deadline_s=deadline_s,
        fencing=intent.resources,
        blobs=intent.blobs,
        intended=_intended(mission, intent) if protocol.proposes_facts(card.protocol) else UNSET,
    )


def _intended(mission: Mission, intent: DispatchIntended) -> tuple[protocol.IntendedEffect, ...]:
    node = required_contract(mission).node(intent.node_id)
    return tuple(
        protocol.IntendedEffect(condition_id=one.condition_id, effect=one.effect) for one in node.success_conditions
    )
