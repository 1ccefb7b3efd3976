"""Draws the arms over generations as SVG. Pure. Colours follow the reader's theme; every line has its name and its dash
pattern.
"""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

WIDTH, HEIGHT = 760, 340
LEFT, RIGHT, TOP, BOTTOM = 64, 132, 44, 46
COLOURS: dict[str, tuple[str, str]] = {
    "frozen": ("#5d6873", "#a9b4bf"), "gated": ("#0a6b4f", "#4fd1a5"), "ungated": ("#b3261e", "#ff8a80"),
    "random": ("#8a5a00", "#f0b44c"), "batch": ("#1f5fbf", "#82b1ff"), "expert": ("#6b3fa0", "#c9a6ff"),
}  # fmt: skip
"""Light and dark, by arm; each reads at 4.5 to 1 on its ground."""
DASHES = {"frozen": "2 4", "gated": "none", "ungated": "8 3", "random": "4 3", "batch": "10 3 2 3", "expert": "1 3"}
LEAST_GAP = 15.0
Row = Mapping[str, Any]


def plot(rows: Sequence[Row], *, measure: str, title: str, unit: str) -> str:
    """Means over generations with their intervals as bands. Rows as `report.rows` makes them."""
    if not rows:
        return ""
    generations = sorted({int(row["generation"]) for row in rows})
    top = max(max(row[f"{measure}_ci"][1], row[measure]) for row in rows)
    most = _round_up(top)

    def x(generation: int) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (generation / max(generations[-1], 1))

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (value / most)

    arms = list(dict.fromkeys(str(row["arm"]) for row in rows))
    parts = [
        _style(arms),
        f'<text class="t" x="{LEFT}" y="24">{escape(title)}</text>',
        *_axes(generations, most, x, y, unit),
    ]
    ends: list[tuple[float, str]] = []
    for arm in arms:
        line = sorted((row for row in rows if row["arm"] == arm), key=lambda row: int(row["generation"]))
        above = [f"{x(row['generation']):.1f},{y(row[f'{measure}_ci'][1]):.1f}" for row in line]
        below = [f"{x(row['generation']):.1f},{y(row[f'{measure}_ci'][0]):.1f}" for row in reversed(line)]
        points = " ".join(f"{x(row['generation']):.1f},{y(row[measure]):.1f}" for row in line)
        parts += [
            f'<polygon class="b {arm}" points="{" ".join([*above, *below])}"/>',
            f'<polyline class="l {arm}" points="{points}"/>',
        ]
        ends.append((y(line[-1][measure]), arm))
    parts += _labels(ends)
    described = f"{title}. " + "; ".join(_caption_of(rows, arm, measure) for arm in arms)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'font-family="system-ui, sans-serif" font-size="13">\n<title>{escape(title)}</title>\n'
        f"<desc>{escape(described)}</desc>\n" + "\n".join(parts) + "\n</svg>\n"
    )


def _style(arms: Sequence[str]) -> str:
    light = "".join(f".l.{arm}{{stroke:{COLOURS[arm][0]}}}.b.{arm},.n.{arm}{{fill:{COLOURS[arm][0]}}}" for arm in arms)
    dark = "".join(f".l.{arm}{{stroke:{COLOURS[arm][1]}}}.b.{arm},.n.{arm}{{fill:{COLOURS[arm][1]}}}" for arm in arms)
    dashes = "".join(f".l.{arm}{{stroke-dasharray:{DASHES[arm]}}}" for arm in arms)
    return (
        "<style>.l{fill:none;stroke-width:2.2}.b{opacity:.12}.t{font-weight:600;font-size:15px}"
        f".g{{stroke:#98a2ad;stroke-width:.5}}.paper{{fill:#fff}}text{{fill:#1d2329}}{light}{dashes}"
        "@media (prefers-color-scheme:dark){.paper{fill:#14181d}text{fill:#e8ecf0}.g{stroke:#56616c}"
        f'{dark}}}</style><rect class="paper" width="{WIDTH}" height="{HEIGHT}"/>'
    )


def _axes(generations: Sequence[int], most: float, x: Any, y: Any, unit: str) -> list[str]:
    parts = []
    for step in range(5):
        value = most * step / 4
        parts += [
            f'<line class="g" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(value):.1f}" y2="{y(value):.1f}"/>',
            f'<text x="{LEFT - 8}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>',
        ]
    parts += [
        f'<text x="{x(one):.1f}" y="{HEIGHT - BOTTOM + 20}" text-anchor="middle">{one}</text>' for one in generations
    ]
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text x="{middle:.0f}" y="{HEIGHT - 8}" text-anchor="middle">generation</text>')
    parts.append(f'<text x="{LEFT}" y="{TOP - 6}">{escape(unit)}</text>')
    return parts


def _labels(ends: Sequence[tuple[float, str]]) -> list[str]:
    """Names at the ends of the lines, moved apart where they would overlap."""
    placed = -1e9
    parts = []
    for height, arm in sorted(ends):
        placed = max(height + 4.0, placed + LEAST_GAP)
        parts.append(f'<text class="n {arm}" x="{WIDTH - RIGHT + 10}" y="{placed:.1f}">{arm}</text>')
    return parts


def _caption_of(rows: Sequence[Row], arm: str, measure: str) -> str:
    line = sorted((row for row in rows if row["arm"] == arm), key=lambda row: int(row["generation"]))
    return f"{arm}: {line[0][measure]:.3g} at generation {line[0]['generation']}, {line[-1][measure]:.3g} at the last"


def _round_up(value: float) -> float:
    """The next of 1, 2, 2.5, 4, 5, 8 and 10 times a power of ten."""
    if value <= 0:
        return 1.0
    scale = 1.0
    while scale * 10 <= value:
        scale *= 10
    while scale > value:
        scale /= 10
    return next(scale * step for step in (1.0, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0) if scale * step >= value)
