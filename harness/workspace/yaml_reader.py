"""Reads YAML text into contract values: every problem names the place in the value and its line in the text."""

from collections.abc import Hashable, Sequence
from functools import cached_property
from typing import Any, TypeVar

import msgspec
import yaml

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

T = TypeVar("T")
Step = str | int
LONGEST_TEXT = 262_144
DEEPEST = 24
_UNKNOWN_FIELD = "unknown field `"


def read_yaml(text: str, kind: type[T], *, where: str) -> T:
    """YAML of one contract value. Raises ContractInvalid that names the line and the place in the file or the value.

    Aliases, repeated keys, deep nesting and texts over 256 KiB are refused before anything is built from them: a file
    of a few lines can otherwise unfold to gigabytes.
    """
    if len(text) > LONGEST_TEXT:
        raise ContractInvalid(because("text_too_long", characters=len(text), limit=LONGEST_TEXT), where=where)
    try:
        _check_events(text, where)
        built = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ContractInvalid(because("yaml_invalid", error=_line(error)), where=where) from error
    except ValueError as error:
        raise ContractInvalid(because("value_unreadable", error=str(error)), where=where) from error
    try:
        return msgspec.convert(built, kind, strict=True)
    except msgspec.ValidationError as error:
        what, _, path = str(error).partition(" - at `")
        path = path.rstrip("`") or "$"
        raise ContractInvalid(
            because("field_invalid", error=what), where=f"{where}, line {_line_of_error(text, what, path)}, {path}"
        ) from error


class Lines:
    """Where the parts of a YAML text stand: `of("places", 0, "name")` is the line of that value, from 1."""

    def __init__(self, text: str) -> None:
        self._text = text

    @cached_property
    def _root(self) -> yaml.Node | None:
        try:
            return yaml.compose(self._text, Loader=yaml.CSafeLoader)
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


class _Loader(yaml.CSafeLoader):
    """CSafeLoader that takes no key twice, no key that is a list or mapping, and no merged keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == "tag:yaml.org,2002:merge":
                raise yaml.constructor.ConstructorError(None, None, "a key must be a plain word", key.start_mark)
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key.value!r} stands twice", key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def _check_events(text: str, where: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        line = event.start_mark.line + 1 if event.start_mark else 0
        if isinstance(event, yaml.AliasEvent):
            raise ContractInvalid(because("yaml_alias", line=line), where=where)
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            raise ContractInvalid(because("yaml_too_deep", line=line, limit=DEEPEST), where=where)


def _line(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    return f"{problem} (line {mark.line + 1})" if mark else str(problem)
