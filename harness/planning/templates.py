"""Checks a goal text, and finds a task template by its name. Pure and deterministic."""

from collections.abc import Sequence

from harness.contracts.errors import ContractInvalid
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


def by_name(name: str, templates: Sequence[TaskTemplate]) -> TaskTemplate:
    """The template of that name; raises UnknownName with the nearest one."""
    for template in templates:
        if template.name == name:
            return template
    raise unknown("template", name, known=[template.name for template in templates])
