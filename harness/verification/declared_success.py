"""Judges a success that somebody else declared, by samples alone: what shows it, what is lacking, what contradicts it.

Nothing here becomes a fact. A recording's successes (`regen audit bags`) and those of a robot that is only observed are
judged by the same rules.
"""

import math
from collections.abc import Iterable

from harness.contracts.declared_successes import LACKS, DeclaredSuccess, Lack, SuccessFinding
from harness.contracts.observations import AnySample, Pose
from harness.contracts.values import Point

TOLERANCE_M = 0.40
FRESH_S = 1.0
STANDS_FOR_S = 2.0
STANDS_WITHIN_M = 0.10


class SuccessJudge:
    """Folds samples in order of arrival around one declared success; holds a few seconds of positions."""

    def __init__(self, success: DeclaredSuccess, *, tolerance_m: float = TOLERANCE_M) -> None:
        self._success, self._tolerance_m = success, tolerance_m
        self._before: Pose | None = None
        self._after: list[Pose] = []

    def add(self, sample: AnySample) -> None:
        """Take one more sample into account."""
        if not isinstance(sample, Pose):
            return
        since_s = sample.at_s - self._success.at_s
        if since_s <= 0.0:
            self._before = sample
        elif since_s <= STANDS_FOR_S:
            self._after.append(sample)

    def finding(self, *, single_source: bool) -> SuccessFinding:
        """What the samples so far show. `single_source`: position and motion come from one estimator."""
        at = self._position()
        distance_m = math.dist(at, self._success.target_m) if at and self._success.target_m else None
        moved_m = self._moved_m()
        evidence: dict[Lack, bool] = {
            "target": self._success.target_m is not None,
            "position": at is not None,
            "arrival": distance_m is not None and distance_m <= self._tolerance_m,
            "standstill": moved_m is not None and moved_m <= STANDS_WITHIN_M,
            "second_source": not single_source,
        }
        lacks = tuple(one for one in LACKS if not evidence[one])
        contradicted = distance_m is not None and distance_m > self._tolerance_m
        return SuccessFinding(
            success=self._success,
            verdict="contradicted" if contradicted else "lacking" if lacks else "backed",
            lacks=lacks,
            distance_m=distance_m,
            moved_m=moved_m,
        )

    def _position(self) -> Point | None:
        """Where it was at that moment: the newest position of the second before, no other."""
        if self._before is None or self._success.at_s - self._before.at_s > FRESH_S:
            return None
        return self._before.x_m, self._before.y_m

    def _moved_m(self) -> float | None:
        """None where the two seconds after it are not covered by positions."""
        if not self._after or self._after[-1].at_s - self._success.at_s < STANDS_FOR_S - FRESH_S:
            return None
        first = self._position() or (self._after[0].x_m, self._after[0].y_m)
        return max(math.dist(first, (one.x_m, one.y_m)) for one in self._after)


def judged(
    successes: Iterable[DeclaredSuccess], samples: Iterable[AnySample], *, single_source: bool
) -> tuple[SuccessFinding, ...]:
    """Every success over one pass of the samples, which are in order of arrival."""
    judges = [SuccessJudge(one) for one in successes]
    for sample in samples:
        for judge in judges:
            judge.add(sample)
    return tuple(judge.finding(single_source=single_source) for judge in judges)
