"""Shapes the editor of a candidate: the fields of H with unit, bounds and meaning, and what is wrong with each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import msgspec

from app.i18n.messages import lazy_gettext, reasoned, word
from app.views.forms import SelectOption
from app.views.shell import Shell
from harness.contracts.configuration import Configuration, RecoveryAction
from harness.contracts.fields import Field, fields
from harness.contracts.values import encode
from rsi_reviews.contracts import BETTER, Metric, RestrictionViolation
from rsi_reviews.difference import NAMES, CandidateDifference

LADDERS = "recovery.ladders"
SECTIONS = ("context_rules", "routing", "recovery")
LADDER_NOTE = lazy_gettext(
    "A ladder lists what is tried after a failure of its class, in order. Steps: {rungs}.",
    rungs=" | ".join(get_args(RecoveryAction)),
)


@dataclass(frozen=True)
class EditField:
    """One field of H. `was` is the current value; `wrong` says what to correct."""

    path: str
    title: str
    value: str
    was: str
    unit: str
    bound: str
    meaning: str
    wrong: str


@dataclass(frozen=True)
class EditSection:
    """One component with its fields."""

    name: str
    note: str
    fields: tuple[EditField, ...]


@dataclass(frozen=True)
class EditResult:
    """The result of checking an edit: errors, broken rules and, for a valid edit, what it changes."""

    errors: Sequence[str] = ()
    refusals: Sequence[RestrictionViolation] = ()
    difference: CandidateDifference | None = None


@dataclass(frozen=True)
class EditorPage:
    """The form as the person left it. `by_text` shows the configuration as one JSON text instead of fields."""

    shell: Shell
    baseline: str
    by_text: bool
    sections: tuple[EditSection, ...]
    text: str
    metrics: tuple[SelectOption, ...]
    smallest_effect: str
    reason: str
    intended: str
    supersedes: str
    errors: tuple[str, ...]
    broken: tuple[RestrictionViolation, ...]
    changes: CandidateDifference | None


def editor_page(
    shell: Shell, current: Configuration, typed: Mapping[str, str], *, by_text: bool, found: EditResult
) -> EditorPage:
    chosen = typed.get("metric", "recovery_cost")
    wrong = {_field_path(one.path): reasoned(one.reason) for one in found.refusals}
    return EditorPage(
        shell=shell,
        baseline=current.configuration_id,
        by_text=by_text,
        sections=() if by_text else _sections(current, typed, wrong),
        text=typed.get("configuration", msgspec.json.format(encode(current), indent=2).decode()) if by_text else "",
        metrics=tuple(
            SelectOption(
                one,
                lazy_gettext("{metric}, {direction} is better", metric=word(one), direction=BETTER[one]),
                one == chosen,
            )
            for one in get_args(Metric)
        ),
        smallest_effect=typed.get("smallest_effect", "0.1"),
        reason=typed.get("reason", ""),
        intended=typed.get("intended_effect", ""),
        supersedes=typed.get("supersedes", ""),
        errors=tuple(found.errors),
        broken=tuple(found.refusals),
        changes=found.difference if not found.refusals else None,
    )


def edited_text(current: Configuration, typed: Mapping[str, str]) -> str:
    """The configuration with the typed fields in it, as JSON. What was typed wrongly stays text: reading refuses it."""
    tree: dict[str, Any] = msgspec.to_builtins(current)
    for path, was in _leaves(tree):
        text = typed.get(path)
        if text is not None and text.strip() != _display_value(was):
            section, _, rest = path.partition(".")
            owner = tree[section][LADDERS.partition(".")[2]] if path.startswith(f"{LADDERS}.") else tree[section]
            owner[rest.rpartition(".")[2]] = _typed(text.strip(), was)
    return msgspec.json.encode(tree).decode()


def _sections(current: Configuration, typed: Mapping[str, str], wrong: Mapping[str, str]) -> tuple[EditSection, ...]:
    known = {one.path: one for one in fields()}
    leaves = list(_leaves(msgspec.to_builtins(current)))
    return tuple(
        EditSection(
            name=NAMES[section],
            note=LADDER_NOTE if section == "recovery" else "",
            fields=tuple(
                _field(path, was, known, typed, wrong) for path, was in leaves if path.startswith(f"{section}.")
            ),
        )
        for section in SECTIONS
    )


def _field(
    path: str, was: Any, known: Mapping[str, Field], typed: Mapping[str, str], wrong: Mapping[str, str]
) -> EditField:
    about = known.get(path) or known.get(path.rpartition(".")[0])
    ladder = path.startswith(f"{LADDERS}.")
    return EditField(
        path=path,
        title=word(path.rpartition(".")[2].removesuffix("_s")),
        value=typed.get(path, _display_value(was)),
        was=_display_value(was),
        unit=about.unit if about else "",
        bound="" if ladder or about is None else about.bound,
        meaning="" if ladder or about is None else about.meaning,
        wrong=wrong.get(path, ""),
    )


def _leaves(tree: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """(path, value) of the three sections that fields can be typed for; ladders one by one."""
    found: list[tuple[str, Any]] = []
    for section in SECTIONS:
        for name, value in tree[section].items():
            path = f"{section}.{name}"
            if path == LADDERS:
                found += [(f"{LADDERS}.{failure}", ladder) for failure, ladder in sorted(value.items())]
            else:
                found.append((path, value))
    return found


def _display_value(value: Any) -> str:
    return (
        " > ".join(value)
        if isinstance(value, list | tuple)
        else f"{value:g}"
        if isinstance(value, float)
        else str(value)
    )


def _typed(text: str, was: Any) -> Any:
    """The typed text as a value of the old value's type; unchanged text if it cannot be read as that."""
    if isinstance(was, list | tuple):
        return [one.strip() for one in text.split(">") if one.strip()]
    try:
        return int(text) if isinstance(was, int) else float(text)
    except ValueError:
        return text


def _field_path(path: str) -> str:
    """The name of the form field for a path in a refusal."""
    return path.removeprefix("$.").removeprefix("candidate, $.").replace("[...]", "")
