"""Reads YAML text into contract values: every problem names the place in the value and its line in the text."""

from collections.abc import Sequence
from functools import cached_property
from typing import TypeVar

import msgspec
import yaml

from harness.adapters.bounded_yaml import foreign_values, plain_values
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

T = TypeVar("T")
Step = str | int
_UNKNOWN_FIELD = "unknown field `"


def read_yaml(text: str, kind: type[T], *, where: str, foreign: bool = False) -> T:
    """YAML of one contract value. Raises ContractInvalid that names the line and the place in the file or the value.

    `foreign`: anybody may have written it, so that a process with limits reads it.
    """
    built = foreign_values(text, where=where) if foreign else plain_values(text, where=where)
    try:
        return msgspec.convert(built, kind, strict=True)
    except msgspec.ValidationError as error:
        what, _, path = str(error).partition(" - at `")
        path = path.rstrip("`") or "$"
        raise ContractInvalid(
            because("field_invalid", error=what), where=f"{where}:{_line_of_error(text, what, path)}, {path}"
        ) from error


class Lines:
    """Where the parts of a YAML text stand: `of("places", 0, "name")` is the line of that value, from 1."""

    def __init__(self, text: str) -> None:
        self.text = text

    @cached_property
    def _root(self) -> yaml.Node | None:
        try:
            return yaml.compose(self.text, Loader=yaml.CSafeLoader)
        except yaml.YAMLError:
            return None

    def of(self, *path: Step) -> int:
        """The line of the deepest part of the path that the text has."""
        node, line = self._root, 1
        for step in path:
            found = _child(node, step)
            if found is None:
                break
            line, node = found
        return line


def _child(node: yaml.Node | None, step: Step) -> tuple[int, yaml.Node] | None:
    if isinstance(node, yaml.SequenceNode) and isinstance(step, int) and step < len(node.value):
        found = node.value[step]
        return found.start_mark.line + 1, found
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value == step:
                return key.start_mark.line + 1, value
    return None


def _line_of_error(text: str, what: str, path: str) -> int:
    """The line of msgspec's path `$.places[0].name`; of an unknown field, that field's own."""
    steps = list(_steps(path))
    if _UNKNOWN_FIELD in what:
        steps.append(what.partition(_UNKNOWN_FIELD)[2].partition("`")[0])
    return Lines(text).of(*steps)


def _steps(path: str) -> Sequence[Step]:
    found: list[Step] = []
    for part in path.removeprefix("$").replace("[", ".[").split("."):
        if part.startswith("["):
            number = part[1:-1]
            if not number.isdecimal():
                break
            found.append(int(number))
        elif part:
            found.append(part)
    return found
