"""Acts on robots outside any mission: stop all, send to safety, posture, and driving by hand."""

from typing import Annotated

from pydantic import Field

from app.acts import base
from harness.contracts import control, retreat_events
from harness.contracts.control import Posture


class StopRobotAct(base.ActModel):
    """Stop whatever moves this robot: its mission, a person's hand, its way to safety. The reason may come later."""

    reason: base.Text = ""


class ExplainStopAct(base.ActModel):
    """Say why a robot was stopped, afterwards: the audit log keeps it."""

    reason: base.Reason


class StopRobotsAct(base.ActModel):
    """Stop every mission of every robot and end all manual control; `safe`: then send each robot to safety."""

    reason: base.Text = ""
    safe: bool = False


class SendToSafetyAct(base.Act):
    """Stop what a robot does and send it to the safe place of its zone; without one, or without `drive`, it lies down.

    A robot that is on its way there is stopped instead.
    """

    becomes = retreat_events.SendRetreat
    reason: base.Reason


class OrderPostureAct(base.Act):
    """Lie down or stand up, where no mission acts."""

    becomes = control.OrderPosture
    posture: Posture
    reason: base.Reason


class BeginTeleoperationAct(base.Act):
    """Drive a robot by hand: refused while a mission may move it. Everybody sees from which `device`."""

    becomes = control.BeginTeleoperation
    device: base.Text = ""
    reason: base.Reason


class EndTeleoperationAct(base.Act):
    """End driving by hand; the base is free once the body is shown at rest."""

    becomes = control.EndTeleoperation
    reason: base.Reason


class SteerAct(base.ActModel):
    """One moment of driving: forward speed and turn rate, in m/s and rad/s; the robot caps both."""

    session: Annotated[str, Field(min_length=1, max_length=64)]
    v_mps: Annotated[float, Field(ge=-1.0, le=1.0)] = 0.0
    w_radps: Annotated[float, Field(ge=-2.0, le=2.0)] = 0.0
