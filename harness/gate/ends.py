"""Decides failures without a packet, people's answers, and how missions end. Pure."""

from msgspec.structs import replace

from harness.contracts import commands, events
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import UNEXPLAINED, Reason, because
from harness.contracts.revision_commands import WithdrawMission
from harness.gate.dispatch import accounted, spend
from harness.gate.pins import BEFORE_ACTIVE
from harness.projections.mission import Mission, required_contract
from harness.recovery.classify import classify


def unfinished(
    mission: Mission, command: commands.RefusePrecondition | commands.ReportFailure | commands.EndInvocation
) -> Decision[events.MissionEvent]:
    """A failure without a packet, with its class."""
    match command:
        case commands.RefusePrecondition():
            give_up = command.at_s + required_contract(mission).node(command.node_id).timeout_s
            unmet = events.PreconditionRefused(
                node_id=command.node_id, precondition=command.precondition, reason=command.reason, give_up_s=give_up
            )
            failure = events.FailureClassified(
                node_id=command.node_id,
                invocation_id=None,
                failure="precondition_unmet",
                reason=command.reason,
                at_s=command.at_s,
            )
            return Accepted((unmet, failure))
        case commands.ReportFailure():
            if mission.of(command.node_id).failure is not None:
                return refused("failure_open", node_id=command.node_id)
            failure = events.FailureClassified(
                node_id=command.node_id,
                invocation_id=command.invocation_id,
                failure=command.failure,
                reason=command.reason,
                at_s=command.at_s,
            )
            return Accepted((failure,))
        case commands.EndInvocation():
            return _ended(mission, command)


def _ended(mission: Mission, command: commands.EndInvocation) -> Decision[events.MissionEvent]:
    invocation = mission.invocation
    if invocation is None or invocation.intent.invocation_id != command.invocation_id:
        return refused("not_open", because("invocation_not_open", invocation_id=command.invocation_id))
    ended = events.InvocationEnded(
        invocation_id=command.invocation_id, status=command.status, failure=command.failure, reason=command.reason
    )
    failure = events.FailureClassified(
        node_id=invocation.intent.node_id,
        invocation_id=command.invocation_id,
        failure=classify(verdict=None, terminal=command.status, failure_word=command.failure) or "interrupted",
        reason=command.reason,
        at_s=command.at_s,
    )
    return Accepted((ended, failure))


def stop_invocation(mission: Mission, command: commands.StopInvocation) -> Decision[events.MissionEvent]:
    """The supervisor asks a provider to stop; for a recovery step the free spend is recorded with it."""
    invocation = mission.invocation
    if invocation is None or invocation.intent.invocation_id != command.invocation_id:
        return refused("not_open", because("invocation_not_open", invocation_id=command.invocation_id))
    if invocation.stop_requested:
        return Accepted(())
    requested = events.InvocationStopRequested(invocation_id=command.invocation_id, reason=command.reason)
    if command.recovery is None:
        return Accepted((requested,))
    node = mission.of(invocation.intent.node_id)
    step = spend(
        node,
        command.recovery,
        attempt=node.attempt,
        context=command.recovery_context or invocation.intent.context,
        until_s=None,
    )
    return Accepted((accounted(mission, replace(step, cost=0)), requested))


def ask(mission: Mission, command: commands.AskPerson) -> Decision[events.MissionEvent]:
    """The mission waits for a person. Free and always possible (D24), except with a body that may move."""
    if mission.status != "active":
        return refused("not_active", because("mission_is", status=mission.status))
    if mission.invocation is not None and mission.invocation.status != "outcome_unknown":
        return refused("invocation_open", because("stop_before_asking"))
    requested = events.HandoffRequested(
        handoff_id=command.handoff_id,
        node_id=command.node_id,
        failure=command.failure,
        reason=command.reason,
        context=command.context,
    )
    return Accepted((requested,))


def answer(mission: Mission, command: commands.AnswerMission) -> Decision[events.MissionEvent]:
    """Rejected or unanswered ends safely stopped: the robot is already at standstill."""
    if mission.handoff_id != command.handoff_id:
        return refused("not_waiting", because("not_waiting_for_handoff", handoff_id=command.handoff_id))
    answered = events.HandoffAnswered(
        handoff_id=command.handoff_id, decision=command.decision, actor=command.actor, reason=command.reason
    )
    if command.decision == "superseded":
        return Accepted((answered,))
    why = because("handoff_was_answered", actor=command.actor.name, decision=command.decision, reason=command.reason)
    if command.decision == "closed":
        return Accepted(
            (answered, events.FailureReported(text=why), events.MissionEnded(status="handed_off", reason=why))
        )
    return Accepted(
        (answered, events.FailureReported(text=why), events.MissionEnded(status="safe_stopped", reason=why))
    )


def pause(mission: Mission, command: commands.PauseMission) -> Decision[events.MissionEvent]:
    """New work waits; the supervisor stops an open invocation."""
    if mission.status not in ("active", "awaiting_human"):
        return refused("not_active", because("mission_is", status=mission.status))
    return Accepted((events.MissionPaused(actor=command.actor, reason=command.reason),))


def resume(mission: Mission, command: commands.ResumeMission) -> Decision[events.MissionEvent]:
    """Go on after a pause."""
    if mission.status != "paused":
        return refused("not_paused", because("mission_is", status=mission.status))
    return Accepted((events.MissionResumed(actor=command.actor, reason=command.reason),))


def stop(mission: Mission, command: commands.StopMission) -> Decision[events.MissionEvent]:
    """Always possible. The mission is STOPPING until the stop is acknowledged and the body at standstill.

    A stop that was pressed without a reason takes the first one that is given meanwhile.
    """
    if mission.status == "stopping" and not _unexplained(mission, command):
        return Accepted(())
    return Accepted((events.StopRequested(actor=command.actor, reason=command.reason),))


def _unexplained(mission: Mission, command: commands.StopMission) -> bool:
    given = mission.stop.reason if mission.stop is not None else ""
    unsaid = isinstance(given, Reason) and given.code == UNEXPLAINED.code
    return unsaid and not (isinstance(command.reason, Reason) and command.reason.code == UNEXPLAINED.code)


def withdraw(mission: Mission, command: WithdrawMission) -> Decision[events.MissionEvent]:
    """A mission that waits for its robot ends at once: nothing of it was dispatched, so there is nothing to stop."""
    if mission.status not in BEFORE_ACTIVE:
        return refused("begun", because("mission_begun", status=mission.status))
    why = because("withdrawn_before_begin", actor=command.actor.name, reason=command.reason)
    request = events.StopRequested(actor=command.actor, reason=command.reason)
    return Accepted((request, events.FailureReported(text=why), events.MissionEnded(status="cancelled", reason=why)))


def acknowledge(mission: Mission, command: commands.AcknowledgeStop) -> Decision[events.MissionEvent]:
    """Stopped means acknowledged and at standstill; without such evidence the mission fails and says so."""
    if mission.stop is None:
        return refused("no_stop", because("no_stop_asked"))
    acknowledged = events.StopAcknowledged(static=command.static, measured=command.measured, reason=command.reason)
    why = because("mission_stopped_by", actor=mission.stop.actor.name, reason=mission.stop.reason)
    if command.static:
        return Accepted(
            (acknowledged, events.FailureReported(text=why), events.MissionEnded(status="cancelled", reason=why))
        )
    unsure = because("stopped_without_rest", stopped=why, why=command.reason)
    return Accepted(
        (acknowledged, events.FailureReported(text=unsure), events.MissionEnded(status="failed", reason=unsure))
    )


def end(mission: Mission, command: commands.EndMission) -> Decision[events.MissionEvent]:
    """Every end without success. A replay may end at any time: nothing moves in it."""
    if mission.invocation is not None and mission.invocation.status != "outcome_unknown" and not mission.replay:
        return refused("invocation_open", because("stop_before_ending"))
    return Accepted(
        (events.FailureReported(text=command.reason), events.MissionEnded(status=command.status, reason=command.reason))
    )
