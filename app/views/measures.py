"""Shapes numbers, with units taken from their names, and measured values beside their bounds."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from app.i18n.catalogues import N_
from app.i18n.messages import listed, word
from app.i18n.task_texts import in_words
from harness.contracts.tasks import TaskContract
from harness.contracts.verdicts import ConditionResult

DIGEST = re.compile("[0-9a-f]{64}")
MANY, FEW = 6, 3
"""How many quantities of a condition are shown at once: with bounds, or without any."""
UNITS = {
    "m": "m", "s": "s", "rad": "rad", "deg": "°", "px": "px", "mps": "m/s", "radps": "rad/s", "m2": "m²", "hz": "Hz",
}  # fmt: skip


@dataclass(frozen=True)
class Measure:
    """One quantity as text: `bound` is empty where nothing limits it."""

    name: str
    value: str
    bound: str = ""


@dataclass(frozen=True)
class ConditionRow:
    """One condition's result, the quantities that are shown at once, and the others.

    `declared`: it rests on what only a provider declares.
    """

    result: ConditionResult
    measures: tuple[Measure, ...]
    others: tuple[Measure, ...]
    declared: bool = False


def number(value: float) -> str:
    """Three significant decimals at most, whole numbers whole."""
    if value != value:
        return N_("not a number")
    if float(value).is_integer() and abs(value) < 1e15:
        return str(int(value))
    return f"{value:.3f}" if abs(value) < 1 else f"{value:.2f}"


def quantity(name: str, value: float | str) -> tuple[str, str]:
    """("distance", "0.09 m") for distance_m = 0.09; names without a known unit keep all their words."""
    if name.endswith("_at_s") and not isinstance(value, str):
        return word(name.removesuffix("_s")), datetime.fromtimestamp(value, UTC).strftime("%H:%M:%S UTC")
    stem, _, suffix = name.rpartition("_")
    unit = UNITS.get(suffix, "") if stem else ""
    label = word(stem if unit else name)
    text = value if isinstance(value, str) else number(value)
    return label, f"{text} {unit}".strip()


def fields(stored: Mapping[str, Any]) -> Iterator[Measure]:
    """What a stored value says, leaf by leaf, `kind` and empty fields left out: numbers with units, digests cut."""
    for name, value in stored.items():
        if isinstance(value, Mapping):
            yield from fields(value)
        elif name != "kind" and value not in (None, "", (), []):
            counts = isinstance(value, int | float) and not isinstance(value, bool)
            yield Measure(*quantity(name, value if counts else _leaf(value)))


def _leaf(value: Any) -> str:
    match value:
        case bool():
            return word("yes" if value else "no")
        case int() | float():
            return number(value)
        case {}:
            return listed(f"{one.name} {one.value}" for one in fields(value))
        case [str() | list() | tuple() | {}, *_]:
            return listed(map(_leaf, value))
        case [*numbers]:
            return f"({', '.join(map(_leaf, numbers))})"
        case _:
            return value[:8] if DIGEST.fullmatch(str(value)) else str(value)


def measures(measured: Mapping[str, float], bounds: Mapping[str, float]) -> tuple[Measure, ...]:
    """Measured values first, each beside the bound of the same name; then bounds that nothing measured."""
    rows = []
    for name, value in measured.items():
        label, text = quantity(name, value)
        rows.append(Measure(name=label, value=text, bound=quantity(name, bounds[name])[1] if name in bounds else ""))
    for name, bound in bounds.items():
        if name not in measured:
            label, text = quantity(name, bound)
            rows.append(Measure(name=label, value="", bound=text))
    return tuple(rows)


def condition_row(result: ConditionResult) -> ConditionRow:
    every = measures(result.measured, result.bounds)
    first = [one for one in every if one.bound][:MANY] or list(every[:FEW])
    return ConditionRow(result=result, measures=tuple(first), others=tuple(one for one in every if one not in first))


def condition_rows(
    results: Sequence[ConditionResult], contract: TaskContract | None = None
) -> tuple[ConditionRow, ...]:
    """A row for each result; the contract lets the texts of its template be said in every language."""
    return tuple(map(condition_row, in_words(results, contract)))


def leading(measured: Mapping[str, float]) -> tuple[Measure, ...]:
    """The first FEW measured quantities."""
    return tuple(Measure(*quantity(name, value)) for name, value in list(measured.items())[:FEW])
