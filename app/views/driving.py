"""Shapes the pad that drives a robot by hand, and the handoff that it was taken over for."""

from dataclasses import dataclass

from app.i18n.messages import reasoned
from app.views.handoffs import title
from app.views.robot_map import RobotMapView
from app.views.robots import RobotCard
from app.views.shell import Shell
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission


@dataclass(frozen=True)
class TakenOver:
    """The question this person took the robot over for. `token` keeps their claim alive until `until_at_s`.

    `left_s` of its deadline remain: they run on once the robot is handed back, or if the claim lapses.
    """

    handoff_id: str
    title: str
    token: str
    until_at_s: float
    left_s: float
    device: str
    reason: str


@dataclass(frozen=True)
class DrivePage:
    """The pad that drives a robot by hand. `session` is empty until this person has control."""

    shell: Shell
    robot: RobotCard
    robot_map: RobotMapView
    session: str
    taken: TakenOver | None
    device: str
    reason: str
    errors: tuple[str, ...]


def taken_over(handoff: Handoff, mission: Mission, *, person: str) -> TakenOver | None:
    """The handoff that this person took the robot over for; None if somebody else drives."""
    claim, control = handoff.claim, handoff.control
    if handoff.taken_by is None or handoff.taken_by.name != person or claim is None or control is None:
        return None
    return TakenOver(
        handoff_id=handoff.handoff_id,
        title=title(handoff, mission),
        token=claim.claim,
        until_at_s=claim.until_at_s,
        left_s=control.left_s,
        device=control.device,
        reason=reasoned(control.reason),
    )
