"""Describes what a candidate changes, by component with unit and meaning, and as a raw difference. Pure."""

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import unified_diff
from typing import Any

import msgspec

from harness.contracts.configuration import Configuration
from harness.contracts.fields import fields
from harness.contracts.values import Value, encode
from rsi_reviews.contracts import SECTIONS, Section

NAMES: dict[str, str] = {
    "context_rules": "Context rules",
    "templates": "Task templates",
    "routing": "Routing",
    "recovery": "Recovery policy",
}
_KEYS = ("node_id", "condition_id", "predicate", "name")


class FieldChange(Value):
    """One field that differs. `path` names stages and conditions; `before` or `after` is empty where there was none."""

    section: Section
    path: str
    before: str
    after: str
    unit: str
    meaning: str


class CandidateDifference(Value):
    """Changes by component in the paper's order, and the unified difference of the two canonical JSON texts."""

    changes: tuple[FieldChange, ...]
    raw: str

    def of(self, section: Section) -> tuple[FieldChange, ...]:
        return tuple(change for change in self.changes if change.section == section)


def difference(baseline: Configuration, candidate: Configuration) -> CandidateDifference:
    """What the candidate changes against its baseline."""
    return CandidateDifference(changes=tuple(_changes(baseline, candidate)), raw=raw_difference(baseline, candidate))


def raw_difference(baseline: Configuration, candidate: Configuration) -> str:
    """Unified difference of both as indented JSON, three lines around each change."""
    before, after = (
        msgspec.json.format(encode(one), indent=2).decode().splitlines(keepends=True) for one in (baseline, candidate)
    )
    return "".join(unified_diff(before, after, fromfile="baseline", tofile="candidate"))


def _changes(baseline: Configuration, candidate: Configuration) -> Iterator[FieldChange]:
    known = {field.path: field for field in fields()}
    for section in SECTIONS:
        before = dict(_leaves(msgspec.to_builtins(getattr(baseline, section)), section, section))
        after = dict(_leaves(msgspec.to_builtins(getattr(candidate, section)), section, section))
        for path in [*before, *(path for path in after if path not in before)]:
            (kind, was), (other, would) = before.get(path, ("", None)), after.get(path, ("", None))
            if was == would:
                continue
            field = known.get(_documented(kind or other, known))
            yield FieldChange(
                section=section,
                path=path,
                before=_display_value(was),
                after=_display_value(would),
                unit=field.unit if field else "",
                meaning=field.meaning if field else "",
            )


def _leaves(value: Any, path: str, kind: str) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Every value with its path in words and the path of its kind, as `fields()` lists them."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, f"{path}.{key}", f"{kind}.{key}")
    elif _keyed(value):
        yield f"{path} (order)", (kind, [_key(item) for item in value])
        for item in value:
            yield from _leaves(item, f"{path}.{_key(item)}", f"{kind}[]")
    else:
        yield path, (kind, value)


def _keyed(value: Any) -> bool:
    return (
        isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) and _key(one) for one in value)
    )


def _key(item: Mapping[str, Any]) -> str:
    return next((str(item[key]) for key in _KEYS if key in item), "")


def _documented(kind: str, known: Mapping[str, Any]) -> str:
    """The nearest documented ancestor: a condition's tolerance is described with its effect."""
    while kind and kind not in known:
        kind = re.sub(r"(\[\]|\.[^.\[\]]*)$", "", kind)
        if "." not in kind and kind not in known:
            return kind
    return kind


def _display_value(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, Sequence) and not isinstance(value, str) and all(isinstance(one, str) for one in value):
        return " > ".join(value)
    return value if isinstance(value, str) else encode(value).decode()
