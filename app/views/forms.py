"""Shapes the forms that start and stop a mission, and what is wrong with what was typed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.i18n.messages import lazy_gettext
from app.views.preview import Preview
from app.views.readings import ReadingView
from app.views.robots import LastReport
from app.views.shell import Shell
from harness.contracts.errors import HarnessError
from harness.contracts.places import Place
from harness.contracts.reasons import Reason
from harness.contracts.tasks import TaskContract, TaskTemplate

REASON_SIGNS = 200
BY_GOAL = "by-goal"
"""The choice of no template: the goal alone says what to do."""
GOAL_SIGNS = 2000
STOP_REASONS = (N_("unexpected motion"), N_("person in the way"), N_("wrong mission"), N_("no longer needed"))


@dataclass(frozen=True)
class SelectOption:
    """One option of a select."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class ParameterField:
    """One thing a template lets the person choose. `places` is empty for text and numbers; `wrong`: what to mend."""

    name: str
    title: str
    type: str
    value: str
    needed: bool
    wrong: str
    places: tuple[SelectOption, ...]


@dataclass(frozen=True)
class RepeatedMission:
    """The mission that a new one repeats, and the stages it did not get accepted."""

    mission_id: str
    goal: str
    status: str
    unaccepted: tuple[str, ...]


@dataclass(frozen=True)
class Before:
    """A mission that the chosen robot does first."""

    mission_id: str
    goal: str
    status: str


@dataclass(frozen=True)
class Wrong:
    """What is wrong with a field of the form; `field` is empty for the form as a whole."""

    field: str
    text: str


@dataclass(frozen=True)
class FormCapture:
    """How the recording on the form came about; the instants are None where they are not known."""

    source: str
    acquired_s: float | None
    recording_s: float | None


@dataclass(frozen=True)
class StartPage:
    """The form that starts a mission; `errors` are shown above it and take the focus, `wrong` beside their fields.

    `ahead` are the missions of the chosen robot that are done first, oldest first. `preview` is a compiled contract,
    `reading` what was read of a goal that was not understood as a whole. `recording` is the stored one that the goal
    was `heard` from.
    """

    shell: Shell
    templates: tuple[SelectOption, ...]
    robots: tuple[SelectOption, ...]
    fields: tuple[ParameterField, ...]
    goal: str
    goal_wrong: str
    robot_wrong: str
    key: str
    errors: tuple[str, ...]
    again: RepeatedMission | None
    ahead: tuple[Before, ...]
    preview: Preview | None
    reading: ReadingView | None = None
    recording: str = ""
    heard: str = ""
    recording_wrong: str = ""
    capture: FormCapture | None = None
    wake_phrase: str = ""


@dataclass(frozen=True)
class FormOptions:
    """What may be chosen: templates, places and robots."""

    templates: Sequence[TaskTemplate]
    places: Sequence[Place]
    robots: Sequence[str]


@dataclass(frozen=True)
class StopPage:
    """The second step of a stop: it names mission and robot, shows how the robot is, and asks for the reason."""

    shell: Shell
    mission_id: str
    robot_id: str
    goal: str
    status: str
    robot: LastReport | None
    reasons: tuple[str, ...]
    errors: tuple[str, ...]


def start_page(
    shell: Shell,
    offer: FormOptions,
    typed: Mapping[str, str],
    *,
    key: str,
    wrong: Sequence[Wrong] = (),
    again: RepeatedMission | None = None,
    ahead: Sequence[Before] = (),
    preview: Preview | None = None,
    reading: ReadingView | None = None,
    wake_phrase: str = "",
) -> StartPage:
    """The form as the person left it; the first template is chosen before anything was typed."""
    templates = offer.templates
    template_name = typed.get("template", "") or (templates[0].name if templates else "")
    template = next((one for one in templates if one.name == template_name), None)
    beside = {one.field: one.text for one in wrong if one.field}
    return StartPage(
        shell=shell,
        templates=(
            *(SelectOption(one.name, one.title, one.name == template_name) for one in templates),
            SelectOption(BY_GOAL, N_("What the goal says"), template_name == BY_GOAL),
        ),
        robots=tuple(SelectOption(one, one, one == typed.get("robot_id", "")) for one in offer.robots),
        fields=_fields(template, offer.places, typed, beside) if template else (),
        goal=typed.get("goal", template.goal if template else ""),
        goal_wrong=beside.get("goal", ""),
        robot_wrong=beside.get("robot_id", ""),
        key=key,
        errors=tuple(one.text for one in wrong),
        again=again,
        ahead=tuple(ahead),
        preview=preview,
        reading=reading,
        recording=typed.get("recording", ""),
        heard=typed.get("heard", ""),
        recording_wrong=beside.get("recording_file", ""),
        capture=_capture(typed) if typed.get("recording") else None,
        wake_phrase=wake_phrase,
    )


def _capture(typed: Mapping[str, str]) -> FormCapture:
    return FormCapture(typed.get("captured_by", ""), _seconds(typed, "acquired_s"), _seconds(typed, "recording_s"))


def _seconds(typed: Mapping[str, str], name: str) -> float | None:
    """A number of the form; None for what is none, which the act refuses when it is sent."""
    try:
        return float(typed.get(name, ""))
    except ValueError:
        return None


def about_field(error: HarnessError, typed: Mapping[str, str], template: TaskTemplate) -> Wrong:
    """An error of the compiler beside the field it is about: the one it names, or whose value it quotes."""
    message = explained(error)
    facts = error.reason.facts.values()
    argument = error.where.facts.get("argument") if isinstance(error.where, Reason) else None
    for parameter in template.parameters:
        value = typed.get(parameter.name, "").strip()
        quoted = bool(value) and (value[:80] in facts or repr(value[:80]) in message)
        if quoted or parameter.name == argument:
            return Wrong(parameter.name, message)
    return Wrong("", message)


def chosen_before(contract: TaskContract, template: TaskTemplate) -> dict[str, str]:
    """What a person had chosen for the template's parameters, as the form's fields take it."""
    found = {}
    for parameter in template.parameters:
        bound = contract.bindings.get(parameter.name)
        if bound is not None:
            found[parameter.name] = str(bound["place_id"] if isinstance(bound, Mapping) else bound)
    return found


def wrong_reason(reason: str) -> list[str]:
    if not reason.strip():
        return [N_("Say why: the reason is kept with the decision.")]
    return (
        [lazy_gettext("Keep the reason below {count} characters.", count=REASON_SIGNS)]
        if len(reason.strip()) > REASON_SIGNS
        else []
    )


def _fields(
    template: TaskTemplate, places: Sequence[Place], typed: Mapping[str, str], wrong: Mapping[str, str]
) -> tuple[ParameterField, ...]:
    return tuple(
        ParameterField(
            name=one.name,
            title=one.title,
            type=one.type,
            value=(value := typed.get(one.name, "" if one.default is None else str(one.default))),
            needed=one.default is None,
            wrong=wrong.get(one.name, ""),
            places=tuple(SelectOption(place.place_id, place.name, place.place_id == value) for place in places)
            if one.type == "place"
            else (),
        )
        for one in template.parameters
    )
