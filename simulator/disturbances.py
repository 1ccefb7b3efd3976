"""Applies a hidden site's recurring disturbances during one mission: which ones occur, where and for how long."""

import math
from collections.abc import Sequence

from harness.contracts.regularities import Regularity, RegularityKind
from harness.contracts.values import Point
from simulator.noise import Streams
from simulator.sensors import LocaliserMode

MODES: dict[RegularityKind, LocaliserMode] = {"unlocalised": "lost", "lagging": "stale", "unready": "lost"}
IN_THE_WAY: tuple[RegularityKind, ...] = ("obstructed", "closed")


class Disturbances:
    """The disturbances in the mission of this seed, from `began_s` on. The draw depends on the seed and the name."""

    def __init__(self, regularities: Sequence[Regularity], *, seed: int, began_s: float) -> None:
        self._striking = tuple(one for one in regularities if _uniform(seed, one.name) < one.share)
        self._began_s = began_s
        self._came_s: dict[str, float] = {}
        self._near: frozenset[str] = frozenset()
        self.moods = any(one.kind in MODES for one in self._striking)
        """Whether any of them concerns the localiser."""

    def pass_by(self, here: Point, at_s: float) -> None:
        """The body is here now: begins every disturbance it has just come near to."""
        near = frozenset(one.name for one in self._striking if math.dist(here, one.at_m) <= one.radius_m)
        for one in self._striking:
            if one.name in near - self._near and (one.kind not in IN_THE_WAY or one.name not in self._came_s):
                self._came_s[one.name] = at_s
        self._near = near

    def mode(self, at_s: float) -> LocaliserMode:
        """The localiser's mode here and now."""
        for one in self._striking:
            if one.kind == "unready":
                here = at_s < self._began_s + (one.lasts_s or math.inf)
            else:
                here = one.name in self._near and self._lasts(one, at_s)
            if here and one.kind in MODES:
                return MODES[one.kind]
        return "good"

    def holds(self, kind: RegularityKind, provider_id: str, at_s: float) -> bool:
        """Whether such a disturbance affects this provider here and now."""
        return any(
            one.kind == kind
            and one.name in self._near
            and one.provider_id in ("", provider_id)
            and self._lasts(one, at_s)
            for one in self._striking
        )

    def in_the_way(self, at_s: float) -> tuple[Regularity, ...]:
        """The obstacle across the route now."""
        return tuple(one for one in self._striking if one.kind in IN_THE_WAY and self._lasts(one, at_s))

    def _lasts(self, one: Regularity, at_s: float) -> bool:
        return one.lasts_s is None or at_s < self._came_s.get(one.name, at_s) + one.lasts_s


def _uniform(seed: int, name: str) -> float:
    return 0.5 * (1.0 + math.erf(Streams(seed).normal(f"regularity/{name}", 0) / math.sqrt(2)))
