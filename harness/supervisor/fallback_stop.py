"""Stops a robot where it is when it cannot go anywhere: it stays, or lies down as far as it can (D27)."""

from harness.contracts.errors import ProviderFailed
from harness.contracts.places import Otherwise
from harness.contracts.protocol import PostureOrder
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Value
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.standstill import Rest


class StopOutcome(Value):
    """Whether the stop was shown to be done, and by what."""

    done: bool
    reason: Reason


def settle(connection: RobotConnection, action: Otherwise, *, rest: Rest, token: int) -> StopOutcome:
    """Stay or lie down, ordered with the newest fencing token of the base."""
    if action == "hold":
        return StopOutcome(done=rest.static, reason=rest.reason or because("at_rest_by_odometry"))
    if connection.hand is None:
        return StopOutcome(done=False, reason=because("cannot_lie_down", robot_id=connection.robot_id))
    try:
        status = connection.hand.rest(PostureOrder(posture="lying", token=token))
    except ProviderFailed as error:
        return StopOutcome(done=False, reason=error.reason)
    return StopOutcome(done=status.posture == "lying", reason=because("declares_posture", posture=status.posture))
