"""Stores the result of a benchmark as one record: printed in a table and kept as JSON with the machine and the
versions.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

DOCS = Path(__file__).resolve().parents[2] / "docs"
RESULTS, PAGE = DOCS / "results" / "performance.json", DOCS / "performance.md"
BEGIN, END = "<!-- figures: written by `make bench` -->", "<!-- end of figures -->"


class Target(msgspec.Struct, frozen=True):
    """The target of a figure: `of` is the peer or lower bound whose multiple `value` is; empty for a plain figure."""

    text: str
    value: float
    better: Literal["lower", "higher"]
    of: str = ""


class Figure(msgspec.Struct, frozen=True, kw_only=True):
    """One row. `peer` and `ratio` are by system; a ratio is ours divided by theirs. `load`: the machine's own."""

    name: str
    unit: str
    ours: float
    peer: dict[str, float] = {}
    floor: float | None = None
    ratio: dict[str, float] = {}
    targets: tuple[Target, ...] = ()
    met: bool | None = None
    n: int
    versions: dict[str, str]
    durability: dict[str, Any]
    detail: dict[str, Any] = {}
    load: float


def figure(
    name: str,
    *,
    unit: str,
    ours: float,
    n: int,
    environment: dict[str, Any],
    peer: dict[str, float] | None = None,
    floor: float | None = None,
    targets: Sequence[Target] = (),
    detail: dict[str, Any] | None = None,
) -> Figure:
    """A row with its ratios computed. `said`: versions and durability of all arms."""
    beside = dict(peer or {}) | ({"floor": floor} if floor is not None else {})
    ratio = {system: round(ours / value, 3) for system, value in beside.items() if value}
    return Figure(
        name=name,
        unit=unit,
        ours=_short(ours),
        peer={system: _short(value) for system, value in (peer or {}).items()},
        floor=None if floor is None else _short(floor),
        ratio=ratio,
        targets=tuple(targets),
        met=all(_is_met(target, ours, ratio) for target in targets) if targets else None,
        n=n,
        versions=environment.get("versions", {}),
        durability=environment.get("durability", {}),
        detail=detail or {},
        load=round(os.getloadavg()[0], 1),
    )


def _is_met(target: Target, ours: float, ratio: dict[str, float]) -> bool:
    if target.of and target.of not in ratio:
        return False
    value = ratio[target.of] if target.of else ours
    return value <= target.value if target.better == "lower" else value >= target.value


def _short(value: float) -> float:
    return float(f"{value:.4g}")


def table(figures: Sequence[Figure]) -> str:
    """The rows as a Markdown table."""
    lines = ["| what | ours | peers (ours / theirs) | floor | target | met |", "|---|---|---|---|---|---|"]
    for one in figures:
        peers = "; ".join(f"{name} {value:g} ({one.ratio.get(name, 0):g}x)" for name, value in one.peer.items())
        floor = "" if one.floor is None else f"{one.floor:g} ({one.ratio.get('floor', 0):g}x)"
        targets = "; ".join(target.text for target in one.targets)
        reached = "" if one.met is None else "yes" if one.met else "no"
        lines.append(f"| {one.name} | {one.ours:g} {one.unit} | {peers} | {floor} | {targets} | {reached} |")
    return "\n".join(lines)


def keep(figures: Sequence[Figure], *, path: Path = RESULTS) -> None:
    """Write these rows into the results; rows with other names stay unchanged."""
    path.parent.mkdir(parents=True, exist_ok=True)
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    mine = {one.name for one in figures}
    rows = [row for row in before if row["name"] not in mine] + [msgspec.to_builtins(one) for one in figures]
    path.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    if path == RESULTS:
        _show(rows)


def _show(rows: Sequence[dict[str, Any]]) -> None:
    """Write the same rows into the table of the page, between its two marks."""
    figures = [msgspec.convert(row, Figure) for row in rows if "targets" in row]
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    versions = sorted({f"{name} {number}" for one in figures for name, number in one.versions.items()})
    loads = ", ".join(f"{one.name}: {one.load:g}" for one in figures)
    text = f"{table(figures)}\n\nVersions: {', '.join(versions)}.\nLoad when each ended: {loads}."
    PAGE.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
