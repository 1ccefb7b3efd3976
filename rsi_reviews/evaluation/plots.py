"""Draws the SVG plots of an evaluation: a bar per arm and condition with its interval. Pure. Colours work on light and
dark.
"""

from collections.abc import Sequence
from html import escape

from rsi_reviews.evaluation.arms import ABLATIONS, COMPARED
from rsi_reviews.evaluation.measures import ConfidenceInterval
from rsi_reviews.evaluation.report import EvaluationReport

LEFT, TOP, ROW, GROUP, WIDTH, BAR = 210, 56, 15, 12, 560, 10
COLOURS = ("#4a7fb5", "#c9822b", "#7a9a3f", "#b04a5a", "#8a6fb0", "#4c9a92")
INK = "#767676"
PLOTS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("success", "success", "Success as the adjudicator sees it", COMPARED),
    ("false-completion", "contract_false", "Contract false completions: the evidence spoke against it", COMPARED),
    ("epistemic", "epistemic_false", "Epistemic false completions: all sensors agreed", COMPARED),
    ("handoffs", "handoff", "Missions that ended with a person", COMPARED),
    ("ablations", "contract_false", "Contract false completions, one thing removed at a time", ABLATIONS),
)  # fmt: skip


BarGroup = tuple[str, Sequence[tuple[int, str, ConfidenceInterval]]]
"""A group's name, and its bars."""


def plots(found: EvaluationReport) -> dict[str, str]:
    """File name without its suffix -> SVG text."""
    return {name: plot(found, measure, title, arms) for name, measure, title, arms in PLOTS}


def plot(found: EvaluationReport, measure: str, title: str, arms: Sequence[str]) -> str:
    """Shares of missions by condition (rows) and arm (bars), with 95 % intervals."""
    groups = [
        (
            condition.name,
            [
                (at, f"{one.arm}, {condition.name}", getattr(one, measure))
                for at, name in enumerate(arms)
                if (one := found.cell(name, condition.name)) is not None
            ],
        )
        for condition in found.conditions
    ]
    return bars(title, f"share of {found.missions_per_cell} missions, 95 % Clopper-Pearson", groups, legend=arms)


def bars(title: str, unit: str, groups: Sequence[BarGroup], *, legend: Sequence[str], most: float = 1.0) -> str:
    """Shares with their intervals, one group of bars below the other; the scale ends at `most`.

    A bar is the place of its colour in the legend, what it is, and the share.
    """
    parts: list[str] = []
    y = top = TOP + 6 + ROW * ((len(legend) + 2) // 3)
    for name, rates in groups:
        if not rates:
            continue
        parts.append(_text(LEFT - 10, y + ROW * len(rates) / 2 + 1, name, anchor="end"))
        for at, label, rate in rates:
            parts += _bar(y, rate, COLOURS[at % len(COLOURS)], label, most)
            y += ROW
        y += GROUP
    height = y + 24
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + 70} {height}" role="img"'
            f' font-family="system-ui, sans-serif" font-size="12">',
            f"<title>{escape(title)}</title>",
            _text(12, 20, f"{title} ({unit})"),
            *_legend(legend),
            *(_tick(share, top, y, most) for share in (0.0, 0.25, 0.5, 0.75, 1.0)),
            *parts,
            "</svg>",
            "",
        ]
    )


def _bar(y: float, rate: ConfidenceInterval, colour: str, name: str, most: float) -> list[str]:
    at = y + ROW / 2
    x, low, high = (LEFT + WIDTH * min(one / most, 1.0) for one in (rate.value, rate.low, rate.high))
    digits = 0 if most >= 0.1 else 2
    value, begin, end = (
        f"{100 * one:.{digits + more}f}" for one, more in ((rate.value, 0), (rate.low, 1), (rate.high, 1))
    )
    text = f"{name}: {value} % ({begin} to {end}), n = {rate.n}"
    return [
        f'<g><title>{escape(text)}</title><rect x="{LEFT}" y="{at - BAR / 2:.1f}" width="{max(x - LEFT, 1):.1f}"'
        f' height="{BAR}" fill="{colour}"/>',
        f'<path d="M{low:.1f} {at:.1f}H{high:.1f}M{low:.1f} {at - 3:.1f}v6M{high:.1f} {at - 3:.1f}v6"'
        f' stroke="{INK}" fill="none"/></g>',
    ]


def _tick(share: float, top: float, bottom: float, most: float) -> str:
    x = LEFT + WIDTH * share
    line = f'<path d="M{x:.1f} {top - 4:.1f}V{bottom:.1f}" stroke="{INK}" stroke-opacity="0.3"/>'
    digits = 0 if most >= 0.1 else 2
    return line + _text(x, bottom + 14, f"{100 * share * most:.{digits}f} %", anchor="middle")


def _legend(arms: Sequence[str]) -> list[str]:
    parts = []
    for at, name in enumerate(arms):
        x, y = LEFT + (at % 3) * 190, 40 + ROW * (at // 3)
        parts.append(f'<rect x="{x}" y="{y - 9}" width="10" height="10" fill="{COLOURS[at % len(COLOURS)]}"/>')
        parts.append(_text(x + 15, y, name))
    return parts


def _text(x: float, y: float, text: str, *, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{INK}">{escape(text)}</text>'
