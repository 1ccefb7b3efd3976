"""What a robot does on the spot where it goes nowhere: stays, or lies down as far as it can (D27)."""

from harness.contracts.errors import ProviderFailed
from harness.contracts.places import Otherwise
from harness.contracts.protocol import PostureOrder
from harness.contracts.reasons import Reason, because, recorded
from harness.contracts.values import Value
from harness.supervisor.crew import Crew
from harness.supervisor.rest import Rest


class Settled(Value):
    """Whether something shows that it was done, and what."""

    done: bool
    reason: Reason


def settle(crew: Crew, action: Otherwise, *, rest: Rest, token: int) -> Settled:
    """Stay or lie down, ordered in its turn by the newest fencing token of the base."""
    if action == "hold":
        return Settled(done=rest.static, reason=rest.reason or because("at_rest_by_odometry"))
    if crew.hand is None:
        return Settled(done=False, reason=because("cannot_lie_down", robot_id=crew.robot_id))
    try:
        status = crew.hand.rest(PostureOrder(posture="lying", token=token))
    except ProviderFailed as error:
        return Settled(done=False, reason=recorded(str(error)[:200]))
    return Settled(done=status.posture == "lying", reason=because("declares_posture", posture=status.posture))
