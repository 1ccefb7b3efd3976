"""Shapes the metric over releases: each canary in order, its missions, its mean, its bound and how it ended."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import get_args

from app.i18n.catalogues import N_
from app.i18n.messages import word
from app.views.axes import ticks
from rsi_reviews.contracts import BETTER, Metric
from rsi_reviews.projections import CanaryEntry, Review

LEFT, TOP, HEIGHT = 64.0, 28.0, 160.0
COLUMN, LEAST_WIDTH = 150.0, 460.0
SPREAD = 0.6
"""The share of a column over which its missions are spread."""
MOST = 12
OUTCOMES = {
    "canary": N_("runs"), "current": N_("released"), "rolled_back": N_("rolled back"), "withdrawn": N_("withdrawn"),
}  # fmt: skip
TONES = {"current": "good", "rolled_back": "bad", "canary": "warn"}


@dataclass(frozen=True)
class MissionDot:
    """One canary mission: red where it counts as worse or a fault was found, hollow where the change took no part."""

    x: float
    y: float
    tone: str
    exercised: bool
    mission_id: str
    value: float


@dataclass(frozen=True)
class CanaryColumn:
    """One canary. `mean_y` is of the missions that exercised it, None without one; beyond `bound_y` counts as worse."""

    review: Review
    began_s: float
    x: float
    left_x: float
    right_x: float
    outcome: str
    tone: str
    dots: tuple[MissionDot, ...]
    mean: float | None
    mean_y: float | None
    bound_y: float


@dataclass(frozen=True)
class ReleasePlot:
    """One metric over the canaries that declared it, oldest left. `ticks` are (y, value)."""

    metric: str
    direction: str
    width: float
    top: float
    height: float
    left_x: float
    columns: tuple[CanaryColumn, ...]
    ticks: tuple[tuple[float, float], ...]
    left_out: int


def release_plots(reviews: Sequence[Review]) -> tuple[ReleasePlot, ...]:
    """A plot for each metric that a canary declared; the newest MOST canaries of each."""
    canaries = sorted((one for one in reviews if one.released_by is not None), key=_began_s)
    by_metric = {
        metric: [one for one in canaries if one.manifest is not None and one.manifest.metric == metric]
        for metric in get_args(Metric)
    }
    return tuple(_plot(metric, found) for metric, found in by_metric.items() if found)


def _plot(metric: Metric, found: Sequence[Review]) -> ReleasePlot:
    newest = found[-MOST:]
    values = [entry.measured.value for one in newest for entry in one.canary] + [one.bound for one in newest]
    low, high = min(0.0, *values), max(*values, 0.0)
    high = high if high > low else low + 1.0

    def y(value: float) -> float:
        return round(TOP + HEIGHT * (high - value) / (high - low), 1)

    width = max(LEFT + COLUMN * len(newest), LEAST_WIDTH)
    return ReleasePlot(
        metric=word(metric),
        direction=BETTER[metric],
        width=width,
        top=TOP,
        height=TOP + HEIGHT,
        left_x=LEFT,
        columns=tuple(_column(one, LEFT + COLUMN * place, y) for place, one in enumerate(newest)),
        ticks=tuple((y(value), value) for value in ticks(low, high)),
        left_out=len(found) - len(newest),
    )


def _column(review: Review, left: float, y: Callable[[float], float]) -> CanaryColumn:
    inside = COLUMN * SPREAD
    first = left + (COLUMN - inside) / 2
    apart = inside / max(len(review.canary) - 1, 1)
    values = [entry.measured.value for entry in review.exercised]
    mean = sum(values) / len(values) if values else None
    return CanaryColumn(
        review=review,
        began_s=_began_s(review),
        x=left + COLUMN / 2,
        left_x=first,
        right_x=first + inside,
        outcome=OUTCOMES.get(review.status, word(review.status)),
        tone=TONES.get(review.status, "plain"),
        dots=tuple(
            MissionDot(
                x=round(first + apart * number if len(review.canary) > 1 else left + COLUMN / 2, 1),
                y=y(entry.measured.value),
                tone="bad" if _bad(entry) else "plain",
                exercised=entry.measured.exercised,
                mission_id=entry.measured.mission_id,
                value=entry.measured.value,
            )
            for number, entry in enumerate(review.canary)
        ),
        mean=mean,
        mean_y=y(mean) if mean is not None else None,
        bound_y=y(review.bound),
    )


def _bad(entry: CanaryEntry) -> bool:
    return entry.measured.worse or bool(entry.measured.hard) or entry.finding not in (None, "sound")


def _began_s(review: Review) -> float:
    return review.released_by.at_s if review.released_by else 0.0
