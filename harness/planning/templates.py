"""Checks a goal text, and finds a task template by its name. Pure and deterministic."""

from collections.abc import Sequence

from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import sha256
from harness.contracts.reasons import because
from harness.contracts.tasks import Goal, TaskTemplate
from harness.planning.binding import unknown

LONGEST_GOAL = 2000


def goal_of(text: str) -> Goal:
    """The goal with its transcript checksum. Raises ContractInvalid if it is empty, too long or not text."""
    if not text.strip():
        raise ContractInvalid(because("goal_empty"), where="goal")
    if len(text) > LONGEST_GOAL:
        raise ContractInvalid(because("goal_too_long", characters=len(text), limit=LONGEST_GOAL), where="goal")
    try:
        return Goal(text=text, digest=sha256(text.encode()))
    except UnicodeEncodeError as error:
        raise ContractInvalid(because("goal_not_unicode"), where="goal") from error


def by_name(name: str, templates: Sequence[TaskTemplate]) -> TaskTemplate:
    """The template of that name; raises UnknownName with the nearest one."""
    for template in templates:
        if template.name == name:
            return template
    raise unknown("template", name, known=[template.name for template in templates])
