"""Checks an approval again just before its one dispatch; it is void if anything it was bound to changed (D28)."""

from msgspec.structs import replace

from harness.contracts.commands import EndInvocation, MarkDispatched, RecordEffect
from harness.contracts.decisions import Refused, refused
from harness.contracts.events import DispatchIntended
from harness.contracts.handoff_commands import VoidApproval
from harness.contracts.ids import HandoffId, RobotId, handoff_stream, mission_stream
from harness.contracts.observations import Pose
from harness.contracts.reasons import Explanation, Reason, because
from harness.gate.commit import CommandEnvelope
from harness.gate.handoffs import moved
from harness.gate.rules import standing_vetoes
from harness.projections.mission import Invocation, Mission
from harness.runtime import Runtime
from harness.supervisor.leases import HeldLeases, give_back
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.roles import RoleContexts
from harness.verification.preconditions import verify_preconditions


def clear_to_send(runtime: Runtime, mission: Mission, invocation: Invocation) -> Refused | None:
    """Mark the approval as dispatched just before it is sent; or return why nothing may be sent any more.

    The person who approved must still be allowed to; the approval must be fresh, and the mission unchanged since it was
    given. What was marked before a crash is never marked again, and so never sent again.
    """
    intent = invocation.intent
    if intent.handoff_id is None:
        return _stopped(invocation)
    why = changed(mission, invocation)
    if why:
        return refused("approval_void", why)
    answer = runtime.handoff(intent.handoff_id).answer
    marked = MarkDispatched(invocation_id=intent.invocation_id, actor=answer.actor if answer else None)
    decision = runtime.commit([CommandEnvelope(handoff_stream(intent.handoff_id), marked, mission.robot_id)])
    return decision if isinstance(decision, Refused) else None


def after_wait(roles: RoleContexts, mission: Mission, invocation: Invocation) -> Refused | None:
    """Why a start that waited after its approval is not sent any more: the robot moved, or a precondition fails."""
    intent = invocation.intent
    if intent.not_before_s is None or intent.handoff_id is None:
        return None
    view, answer = roles.view(mission), roles.runtime.handoff(intent.handoff_id).answer
    results = verify_preconditions(
        view.node(intent.node_id),
        status=view.status,
        recent=view.recent,
        facts=mission.facts,
        at_s=view.at_s,
        rules=view.rules,
    )
    broken = next((one for one in results if one.verdict != "satisfied"), None)
    if broken is not None:
        return refused("approval_void", because("precondition_fails", condition=broken.text, reason=broken.reason))
    pose = next((one for one in reversed(view.recent) if isinstance(one, Pose)), None)
    if answer is None or answer.fresh is None or pose is None:
        return None
    here = replace(
        answer.fresh, x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad, static=roles.observations.rest().static
    )
    return moved(answer.fresh, here)


def changed(mission: Mission, invocation: Invocation) -> Reason | None:
    """What an approval was bound to and no longer holds; None if all of it still holds."""
    intent = invocation.intent
    if mission.status != "active":
        return because("approval_mission_is", status=mission.status)
    if mission.vetoes:
        return because("vetoed", vetoes=standing_vetoes(mission))
    if invocation.stop_requested:
        return because("approval_stop_asked", reason=invocation.stop_requested)
    if mission.k != intent.k_ctx:
        return because("approval_of_another_version", k=mission.k, approved_k=intent.k_ctx)
    return None


def _stopped(invocation: Invocation) -> Refused | None:
    """An invocation stopped before it was sent is not sent at all."""
    if not invocation.stop_requested:
        return None
    return refused("stopped", because("stopped_before_sending", reason=invocation.stop_requested))


def withdraw(
    runtime: Runtime, connection: RobotConnection, mission: Mission, *, intent: DispatchIntended, reason: Explanation
) -> None:
    """End the invocation unsent and free its leases; its approval becomes void, or its effect unknown.

    The stage's status stays unchanged, so that the same person is asked again.
    """
    failures = mission.of(intent.node_id).failures
    ended = EndInvocation(
        invocation_id=intent.invocation_id,
        status="cancelled",
        failure=failures[-1].failure if failures else "interrupted",
        reason=because("never_sent", why=reason),
        at_s=connection.clock.now().mission_s,
    )
    runtime.commit(
        [
            *_void(connection.robot_id, intent.handoff_id, reason),
            CommandEnvelope(mission_stream(mission.mission_id), ended, connection.robot_id),
            *give_back(
                runtime, HeldLeases(connection.robot_id, intent), at_rest=True, reason=because("it_was_never_sent")
            ),
        ]
    )


def _void(robot_id: RobotId, handoff_id: HandoffId | None, reason: Explanation) -> list[CommandEnvelope]:
    if handoff_id is None:
        return []
    stream = handoff_stream(handoff_id)
    lost = because("stopped_while_sending")
    return [
        CommandEnvelope(stream, VoidApproval(reason=reason), robot_id),
        CommandEnvelope(stream, RecordEffect(outcome="unknown", reason=lost), robot_id),
    ]
