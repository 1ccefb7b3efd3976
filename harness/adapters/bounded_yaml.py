"""Reads YAML text into plain values, within bounds; text of others in a process of its own, with limits.

Aliases, repeated keys, deep nesting and long texts are refused before anything is built from them: a file of a few
lines can otherwise unfold to gigabytes.
"""

from collections.abc import Hashable
from functools import lru_cache
from typing import Any

import msgspec
import yaml

from harness.adapters.limited_process import LimitedProcess, Limits
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

LONGEST_TEXT = 262_144
DEEPEST = 24
LIMITS = Limits(memory_bytes=256 * 2**20, cpu_s=20.0, wall_s=120.0, output_bytes=8 * 2**20)
"""For one text of the longest kind, which takes about a second."""


class TextToRead(Value):
    """What the process that reads YAML is asked."""

    text: str
    where: str


def plain_values(text: str, *, where: str, longest: int = LONGEST_TEXT) -> Any:
    """What YAML text holds, read in this very process. Raises ContractInvalid that names the line."""
    if len(text) > longest:
        raise ContractInvalid(because("text_too_long", characters=len(text), limit=longest), where=where)
    try:
        _check_events(text, where)
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ContractInvalid(because("yaml_invalid", error=_line(error)), where=where) from error
    except (ValueError, OverflowError) as error:
        raise ContractInvalid(because("value_unreadable", error=str(error)), where=where) from error


def foreign_values(text: str, *, where: str) -> Any:
    """The same of text that anybody may have written: a process with limits reads it. Raises ContractInvalid."""
    if len(text) > LONGEST_TEXT:
        raise ContractInvalid(because("text_too_long", characters=len(text), limit=LONGEST_TEXT), where=where)
    answer = _reader().run(encode(TextToRead(text=text, where=where)), where=where)
    return msgspec.msgpack.decode(answer)


def read_request(request: bytes) -> bytes:
    """What the process does: plain values as MessagePack, which keeps dates and numbers that JSON does not know."""
    order = decode(request, TextToRead)
    built = plain_values(order.text, where=order.where)
    try:
        return msgspec.msgpack.encode(built)
    except (TypeError, OverflowError, ValueError) as error:
        raise ContractInvalid(because("value_unreadable", error=str(error)), where=order.where) from error


@lru_cache(maxsize=1)
def _reader() -> LimitedProcess:
    """One process for all texts: it starts with the first one."""
    return LimitedProcess(read_request, LIMITS, failure=ContractInvalid)


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
