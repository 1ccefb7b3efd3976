"""Acts on missions: start, stop, pause, resume, withdraw, dispute, and set the level of autonomy."""

from typing import Annotated, Any

from pydantic import Field

from app.acts import base
from harness.contracts import commands, control, revision_commands
from harness.contracts.actors import Actor
from harness.contracts.control import Autonomy
from harness.contracts.ids import RobotId
from harness.runtime import Start


class StartMissionAct(base.Act):
    """A mission to start: a template by name, or a goal that one matches. No robot named: the console's first."""

    becomes = commands.CreateMission
    robot_id: base.Text = ""
    template: base.Text = ""
    goal: Annotated[str, Field(max_length=2000)] = ""
    arguments: dict[base.Slug, Annotated[str, Field(max_length=2000)] | float] = Field(default_factory=dict)
    seed: base.Count = 0
    autonomy: Autonomy = "autonomous"
    labels: dict[base.Slug, base.Text] = Field(default_factory=dict)

    def to_command(self, actor: Actor) -> Start:
        """What the runtime compiles to a CreateMission with its contract."""
        fields = self.fields() | {"robot_id": RobotId(self.robot_id)}
        return Start(actor=actor, **fields)


class _ReasonAct(base.Act):
    """An act that says why; it stands in the log."""

    reason: base.Reason


class StopMissionAct(_ReasonAct):
    """Ask for standstill: the status is `stopping` until it is acknowledged and the body is static."""

    becomes = commands.StopMission


class PauseMissionAct(_ReasonAct):
    """Dispatch nothing more until it is resumed."""

    becomes = commands.PauseMission


class ResumeMissionAct(_ReasonAct):
    """Go on after a pause."""

    becomes = commands.ResumeMission


class WithdrawMissionAct(_ReasonAct):
    """Withdraw a mission that waits for its robot: it ends cancelled at once. Refused once it has begun."""

    becomes = revision_commands.WithdrawMission


class DisputeCompletionAct(_ReasonAct):
    """Say that an accepted completion is wrong: it counts as false, and nothing is deleted. The address names it."""

    becomes = revision_commands.DisputeCompletion
    condition_id: base.Slug

    def body(self) -> dict[str, Any]:
        """The reason alone: the condition stands in the address."""
        return {"reason": self.reason}


class SetAutonomyAct(_ReasonAct):
    """Set how far one mission decides alone, from its next dispatch on."""

    becomes = control.SetAutonomy
    autonomy: Autonomy


class LimitAutonomyAct(_ReasonAct):
    """Set how far any mission may decide alone, from its next dispatch on."""

    becomes = control.LimitAutonomy
    autonomy: Autonomy
