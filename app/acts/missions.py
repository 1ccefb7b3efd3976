"""Acts on missions: start, stop, pause, resume, withdraw, dispute, and set the level of autonomy."""

from collections.abc import Collection, Mapping
from math import isfinite
from typing import Annotated, Any, ClassVar, Literal, Self

from msgspec import UNSET
from pydantic import Field

from app.acts import base
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views import forms
from app.views.forms import Wrong
from harness.contracts import commands, control, revision_commands
from harness.contracts.actors import Actor
from harness.contracts.control import Autonomy
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import RobotId
from harness.contracts.reasons import because
from harness.contracts.spoken_goals import AudioCapture
from harness.contracts.tasks import TaskTemplate, TemplateParameter
from harness.runtime import Start

Wall = Annotated[float, Field(ge=0, le=4e9, allow_inf_nan=False)]
"""Seconds since the epoch."""
CAPTURE = ("captured_by", "acquired_s", "recording_s")


class StartMissionAct(base.Act):
    """A mission to start: a template by name, a goal in words, or both. No robot named: the console's first.

    `confirm_reading`: the digest of the reading that the person confirmed, where words were left unread. `recording`:
    the digest of a recording that was uploaded before; its transcript is the goal. `captured_by`: a microphone or a
    file; of a microphone, `acquired_s` and `recording_s` are when it gave its first samples and when the recording
    began.
    """

    becomes = commands.CreateMission
    sentences: ClassVar[Mapping[str, str]] = {
        "template": N_("Choose what to do: there is no such template."),
        "robot_id": N_("Choose a robot that this installation has."),
        "goal": N_("Say the goal in your own words."),
    }
    robot_id: base.Text = ""
    template: base.Text = ""
    goal: Annotated[str, Field(max_length=forms.GOAL_SIGNS)] = ""
    arguments: dict[base.Slug, Annotated[str, Field(max_length=2000)] | float] = Field(default_factory=dict)
    seed: base.Count = 0
    autonomy: Autonomy = "autonomous"
    labels: dict[base.Slug, base.Text] = Field(default_factory=dict)
    confirm_reading: Annotated[str, Field(pattern="^([0-9a-f]{64})?$")] = ""
    recording: Annotated[str, Field(pattern="^([0-9a-f]{64})?$")] = ""
    captured_by: Literal["", "microphone", "file"] = ""
    acquired_s: Wall | None = None
    recording_s: Wall | None = None

    @classmethod
    def from_form(
        cls, typed: Mapping[str, str], *, template: TaskTemplate | None = None, robots: Collection[str] = ()
    ) -> Self | tuple[Wrong, ...]:
        """A page asks for every choice, and the template's parameters stand beside the act's own fields.

        `template` and `robots` are what can be chosen now. Raises ContractInvalid for a parameter that is too long.
        """
        robot_id, again = typed.get("robot_id", ""), typed.get("rerun_of", "")
        by_goal = typed.get("template") == forms.BY_GOAL
        chosen = {
            "template": template.name if template else forms.BY_GOAL if by_goal else "",
            "robot_id": robot_id if robot_id in robots else "",
            "goal": typed.get("goal", "").strip(),
        }
        parameters = template.parameters if template else ()
        given = [(one, typed.get(one.name, "").strip()) for one in parameters]
        act = super().from_form(chosen)
        wrong = [Wrong(name, cls.sentences[name]) for name, text in chosen.items() if not text]
        wrong += act if isinstance(act, tuple) else ()
        wrong += [Wrong(one.name, sentence) for one, text in given for sentence in _wrong_argument(one, text)]
        if wrong or isinstance(act, tuple):
            return tuple(wrong)
        arguments = {one.name: float(text) if one.type == "number" else text for one, text in given if text}
        more = {"arguments": arguments} | {name: typed.get(name, "") for name in ("confirm_reading", "recording")}
        more |= {name: typed[name] for name in CAPTURE if typed.get(name)} if typed.get("recording") else {}
        more |= {"labels": {"rerun_of": again}} if again else {}
        return cls.of(**dict(act) | more | ({"template": ""} if by_goal else {}))

    @classmethod
    def _messages(cls, name: str, value: Any) -> list[str]:
        if name == "goal":
            return [lazy_gettext("Keep the goal below {count} characters.", count=forms.GOAL_SIGNS)]
        return super()._messages(name, value)

    def to_command(self, actor: Actor, **named: Any) -> Start:
        """What the runtime compiles to a CreateMission with its contract."""
        fields = {name: value for name, value in self.fields().items() if name not in CAPTURE}
        return Start(actor=actor, **fields | {"robot_id": RobotId(self.robot_id), "capture": self._capture()})

    def _capture(self) -> AudioCapture | None:
        """How the recording came about; None where nobody said. Raises ContractInvalid for one that began before its
        microphone."""
        if not self.recording or not self.captured_by:
            return None
        known = self.acquired_s is not None and self.recording_s is not None
        if known and self.recording_s < self.acquired_s:  # type: ignore[operator]
            raise ContractInvalid(because("recording_before_microphone"), where="recording_s")
        return AudioCapture(
            source=self.captured_by,
            acquired_s=UNSET if self.acquired_s is None else self.acquired_s,
            recording_s=UNSET if self.recording_s is None else self.recording_s,
        )


def _wrong_argument(parameter: TemplateParameter, text: str) -> list[str]:
    """What a person is told of a parameter before a mission can be compiled."""
    if not text:
        missing = lazy_gettext("{title} is missing.", title=parameter.title)
        return [missing] if parameter.default is None else []
    if parameter.type == "number" and not _is_number(text):
        return [lazy_gettext("{title} must be a number, not “{value}”.", title=parameter.title, value=text[:40])]
    return []


def _is_number(text: str) -> bool:
    try:
        return isfinite(float(text))
    except ValueError:
        return False


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


class SetAutonomyAct(_ReasonAct):
    """Set how far one mission decides alone, from its next dispatch on."""

    becomes = control.SetAutonomy
    autonomy: Autonomy


class LimitAutonomyAct(_ReasonAct):
    """Set how far any mission may decide alone, from its next dispatch on."""

    becomes = control.LimitAutonomy
    autonomy: Autonomy


ACTS: Mapping[str, type[base.Act]] = {
    "stop": StopMissionAct,
    "withdraw": WithdrawMissionAct,
    "pause": PauseMissionAct,
    "resume": ResumeMissionAct,
}
"""By the word in the address, where the answer is the mission."""
