"""Selects the task template for a goal in words. Pure and deterministic: guesses nothing."""

import re
from collections.abc import Sequence

from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import sha256
from harness.contracts.tasks import Goal, TaskTemplate
from harness.planning.binding import unknown

LONGEST_GOAL = 2000


def goal_of(text: str) -> Goal:
    """The goal with its transcript checksum. Raises ContractInvalid if it is empty, too long or not text."""
    if not text.strip():
        raise ContractInvalid("The goal is empty", where="goal", do="say what the robot shall do")
    if len(text) > LONGEST_GOAL:
        raise ContractInvalid(
            f"The goal has {len(text)} characters, at most {LONGEST_GOAL} are read", where="goal", do="say it shorter"
        )
    try:
        return Goal(text=text, digest=sha256(text.encode()))
    except UnicodeEncodeError as error:
        raise ContractInvalid("The goal is not valid Unicode", where="goal", do="send it as UTF-8") from error


def select(goal: str, templates: Sequence[TaskTemplate]) -> TaskTemplate:
    """The template with the longest phrase that occurs in the goal word by word; ties by name.

    Raises UnknownName that lists what can be asked, ContractInvalid for a goal that is empty or too long.
    """
    said = f" {_spoken(goal_of(goal).text)} "
    matches = [
        (-len(_spoken(phrase)), template.name, template)
        for template in templates
        for phrase in template.phrases
        if f" {_spoken(phrase)} " in said
    ]
    if not matches:
        asks = "; ".join(f"{template.goal!r} ({template.name})" for template in _by_name(templates)) or "nothing"
        raise UnknownName(f"No template matches the goal {goal[:80]!r}", where="goal", do=f"you can ask: {asks}")
    return min(matches, key=lambda match: match[:2])[2]


def by_name(name: str, templates: Sequence[TaskTemplate]) -> TaskTemplate:
    """The template of that name; raises UnknownName with the nearest one."""
    for template in templates:
        if template.name == name:
            return template
    raise unknown("template", name, known=[template.name for template in templates])


def _by_name(templates: Sequence[TaskTemplate]) -> list[TaskTemplate]:
    return sorted(templates, key=lambda template: template.name)


def _spoken(text: str) -> str:
    return " ".join(re.findall(r"\w+", text.casefold()))
