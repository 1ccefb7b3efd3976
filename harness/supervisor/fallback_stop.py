"""Stops a robot that cannot go anywhere where it is: it stays, or lies down as far as it can, and is measured (D27)."""

from collections.abc import Callable

import msgspec

from harness.contracts.control import Posture
from harness.contracts.errors import ProviderFailed
from harness.contracts.places import Otherwise
from harness.contracts.protocol import PostureOrder, RobotStatus
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Value
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.standstill import WINDOW_S, Rest

SHOWN_WITHIN_S = 6.0
"""How long a robot has to be shown in a posture, at rest, after it was told to take it, mission seconds."""
LOOK_S = 0.4
Look = Callable[[], tuple[Rest, RobotStatus | None]]
"""Looks at the robot again: its standstill by odometry, and its own status."""


class StopOutcome(Value):
    """Whether the stop was shown to be done, and by what."""

    done: bool
    reason: Reason
    measured: dict[str, float] = msgspec.field(default_factory=dict)


def settle(connection: RobotConnection, action: Otherwise, *, rest: Rest, token: int, look: Look) -> StopOutcome:
    """Stay or lie down, ordered with the newest fencing token of the base, and shown afterwards."""
    if action == "hold":
        return StopOutcome(done=rest.static, reason=rest.reason or because("at_rest_by_odometry"))
    if connection.hand is None:
        return StopOutcome(done=False, reason=because("cannot_lie_down", robot_id=connection.robot_id))
    try:
        connection.hand.rest(PostureOrder(posture="lying", token=token))
    except ProviderFailed as error:
        return StopOutcome(done=False, reason=error.reason)
    return shown_in_posture(connection, "lying", look)


def shown_in_posture(connection: RobotConnection, posture: Posture, look: Look) -> StopOutcome:
    """Look until the robot says that it lies (or stands) and odometry shows it at rest, for SHOWN_WITHIN_S at most."""
    clock = connection.clock
    until_s = clock.now().mission_s + SHOWN_WITHIN_S
    clock.wait_until(clock.now().mission_s + WINDOW_S)
    while True:
        rest, status = look()
        found = status.posture if status is not None else "unknown"
        if found == posture and rest.static:
            result = because("posture_at_rest", posture=posture, moved_m=rest.measured["displacement_m"])
            return StopOutcome(done=True, reason=result, measured=rest.measured)
        if clock.now().mission_s >= until_s:
            why = rest.reason if found == posture else because("declares_posture", posture=found)
            return StopOutcome(done=False, reason=why or because("rest_not_shown"), measured=rest.measured)
        clock.wait_until(clock.now().mission_s + LOOK_S)
