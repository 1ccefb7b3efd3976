"""Between a person's word and the one dispatch it authorises: void if anything it was bound to changed (D28)."""

from harness.contracts.commands import EndInvocation, MarkDispatched, RecordEffect
from harness.contracts.decisions import Refused
from harness.contracts.events import DispatchIntended
from harness.contracts.handoff_commands import VoidApproval
from harness.contracts.ids import HandoffId, handoff_stream, mission_stream
from harness.contracts.reasons import Explanation, because
from harness.gate.commit import Request
from harness.projections.mission import Invocation, Mission
from harness.runtime import Runtime
from harness.supervisor.crew import Crew
from harness.supervisor.leases import Held, give_back


def clear_to_send(runtime: Runtime, mission: Mission, invocation: Invocation) -> Refused | None:
    """Mark the approval as dispatched, just before it is sent; or why nothing may be sent any more.

    Who approved must still be allowed to; the word must be fresh, and the mission as it was when it was given. What
    was marked before a crash is never marked, and so never sent, again.
    """
    intent = invocation.intent
    if intent.handoff_id is None:
        return _stopped(invocation)
    why = changed(mission, invocation)
    if why:
        return Refused("approval_void", why)
    answer = runtime.handoff(intent.handoff_id).answer
    marked = MarkDispatched(invocation_id=intent.invocation_id, actor=answer.actor if answer else None)
    decision = runtime.commit([Request(handoff_stream(intent.handoff_id), marked)])
    return decision if isinstance(decision, Refused) else None


def changed(mission: Mission, invocation: Invocation) -> Explanation | None:
    """What an approval was bound to and is no longer so; None if all of it still holds."""
    intent = invocation.intent
    if mission.status != "active":
        return because("approval_mission_is", status=mission.status)
    if mission.vetoes:
        return because("stopped_by_veto", vetoes=tuple(mission.vetoes.values()))
    if invocation.stop_requested:
        return because("approval_stop_asked", reason=invocation.stop_requested)
    if mission.k != intent.k_ctx:
        return because("approval_of_another_version", k=mission.k, approved_k=intent.k_ctx)
    return None


def _stopped(invocation: Invocation) -> Refused | None:
    """What was stopped before it was sent is not sent at all."""
    if not invocation.stop_requested:
        return None
    return Refused("stopped", because("stopped_before_sending", reason=invocation.stop_requested))


def withdraw(runtime: Runtime, crew: Crew, mission: Mission, *, intent: DispatchIntended, reason: Explanation) -> None:
    """The invocation ends unsent and its leases are free; a person's word for it is void, or its effect unknown.

    The stage stands where it stood, so that whoever was asked is asked anew.
    """
    failures = mission.of(intent.node_id).failures
    ended = EndInvocation(
        invocation_id=intent.invocation_id,
        status="cancelled",
        failure=failures[-1].failure if failures else "interrupted",
        reason=because("never_sent", why=reason),
        at_s=crew.clock.now().mission_s,
    )
    runtime.commit(
        [
            *_void(intent.handoff_id, reason),
            Request(mission_stream(mission.mission_id), ended),
            *give_back(runtime, Held(crew.robot_id, intent), at_rest=True, reason=because("it_was_never_sent")),
        ]
    )


def _void(handoff_id: HandoffId | None, reason: Explanation) -> list[Request]:
    if handoff_id is None:
        return []
    stream = handoff_stream(handoff_id)
    lost = because("stopped_while_sending")
    return [
        Request(stream, VoidApproval(reason=reason)),
        Request(stream, RecordEffect(outcome="unknown", reason=lost)),
    ]
