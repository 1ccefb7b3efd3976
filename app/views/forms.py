"""Pure: the forms that start and stop a mission, and what is wrong with what was typed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.views.shell import Shell
from harness.contracts.places import Place
from harness.contracts.tasks import TaskTemplate

REASON_SIGNS = 200
STOP_REASONS = ("unexpected motion", "person in the way", "wrong mission", "no longer needed")


@dataclass(frozen=True)
class Choice:
    """One option of a select."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class ParameterField:
    """One thing a template lets the person choose. `places` is empty for text and numbers."""

    name: str
    title: str
    type: str
    value: str
    places: tuple[Choice, ...]


@dataclass(frozen=True)
class StartPage:
    """The form that starts a mission; `errors` are shown above it and take the focus."""

    shell: Shell
    templates: tuple[Choice, ...]
    robots: tuple[Choice, ...]
    fields: tuple[ParameterField, ...]
    goal: str
    key: str
    errors: tuple[str, ...]


@dataclass(frozen=True)
class StopPage:
    """The second step of a stop: it names mission and robot and asks for the reason."""

    shell: Shell
    mission_id: str
    robot_id: str
    goal: str
    status: str
    reasons: tuple[str, ...]
    errors: tuple[str, ...]


def start_page(
    shell: Shell,
    templates: Sequence[TaskTemplate],
    places: Sequence[Place],
    *,
    robots: Sequence[str],
    typed: Mapping[str, str],
    key: str,
    errors: Sequence[str] = (),
) -> StartPage:
    """The form as the person left it; the first template is chosen before anything was typed."""
    wanted = typed.get("template", "") or (templates[0].name if templates else "")
    template = next((one for one in templates if one.name == wanted), None)
    return StartPage(
        shell=shell,
        templates=tuple(Choice(one.name, one.title, one.name == wanted) for one in templates),
        robots=tuple(Choice(one, one, one == typed.get("robot_id", "")) for one in robots),
        fields=_fields(template, places, typed) if template else (),
        goal=typed.get("goal", template.goal if template else ""),
        key=key,
        errors=tuple(errors),
    )


def wrong_start(typed: Mapping[str, str], template: TaskTemplate | None, robots: Sequence[str]) -> list[str]:
    """What a person must mend before a mission can be compiled."""
    wrong = [] if template else ["Choose what to do: there is no such template."]
    if typed.get("robot_id", "") not in robots:
        wrong.append("Choose a robot that this installation has.")
    if not typed.get("goal", "").strip():
        wrong.append("Say the goal in your own words.")
    for parameter in template.parameters if template else ():
        value = typed.get(parameter.name, "").strip()
        if not value and parameter.default is None:
            wrong.append(f"{parameter.title} is missing.")
        if value and parameter.type == "number" and not _is_number(value):
            wrong.append(f"{parameter.title} must be a number, not “{value[:40]}”.")
    return wrong


def arguments(typed: Mapping[str, str], template: TaskTemplate) -> dict[str, str | float]:
    """The template's parameters as typed, numbers as numbers; what was left empty takes its default."""
    given = {one: typed.get(one.name, "").strip() for one in template.parameters}
    return {one.name: float(value) if one.type == "number" else value for one, value in given.items() if value}


def wrong_reason(reason: str) -> list[str]:
    if not reason.strip():
        return ["Say why: the reason is kept with the decision."]
    return [f"Keep the reason below {REASON_SIGNS} signs."] if len(reason.strip()) > REASON_SIGNS else []


def _fields(template: TaskTemplate, places: Sequence[Place], typed: Mapping[str, str]) -> tuple[ParameterField, ...]:
    return tuple(
        ParameterField(
            name=one.name,
            title=one.title,
            type=one.type,
            value=(value := typed.get(one.name, "" if one.default is None else str(one.default))),
            places=tuple(Choice(place.place_id, place.name, place.place_id == value) for place in places)
            if one.type == "place"
            else (),
        )
        for one in template.parameters
    )


def _is_number(text: str) -> bool:
    try:
        return abs(float(text)) < float("inf")
    except ValueError:
        return False
