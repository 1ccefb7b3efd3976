"""The time cursor: the instant that all regions of a mission page show, as an event or a second of mission time."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from app.views.timeline import TimelineEntry

WIDTH = 99.0
"""How much of an axis the history takes, in percent: the newest event must not stand on the edge."""


@dataclass(frozen=True)
class TimeCursor:
    """`position`: the newest event at the instant, None while it follows the head. Seconds of mission time.

    `param` is how the address names it: at=POSITION, t=SECONDS, or nothing. `place` counts events, from 1.
    """

    position: int | None
    at_s: float
    begin_s: float
    end_s: float
    place: int
    count: int
    param: str

    @property
    def total_s(self) -> float:
        return self.end_s - self.begin_s

    @property
    def left(self) -> float:
        """Where the cursor stands on an axis, in percent."""
        return self.left_of(self.at_s)

    @property
    def elapsed_s(self) -> float:
        return self.at_s - self.begin_s

    def left_of(self, at_s: float) -> float:
        """Where an instant stands on an axis, in percent."""
        return round(WIDTH * min(max((at_s - self.begin_s) / max(self.total_s, 0.001), 0.0), 1.0), 3)


def cursor_of(entries: Sequence[TimelineEntry], *, at: int | None, t: float | None, now_s: float) -> TimeCursor:
    """The instant after event `at`, or `t` seconds into the mission; without either the head, which is at `now_s`.

    An instant before the first event is the first event's, one behind the last the last one's. Entries are not empty.
    """
    begin_s = entries[0].mission_s
    end_s = max(entries[-1].mission_s, now_s)
    if at is not None:
        place = max(bisect_right(entries, at, key=lambda entry: entry.position), 1)
        here, at_s, param = entries[place - 1].position, entries[place - 1].mission_s, f"at={at}"
    elif t is not None:
        at_s = min(begin_s + t, end_s)
        place = max(bisect_right(entries, at_s + 1e-6, key=lambda entry: entry.mission_s), 1)
        here, param = entries[place - 1].position, f"t={t:g}"
    else:
        return TimeCursor(
            position=None, at_s=end_s, begin_s=begin_s, end_s=end_s, place=len(entries), count=len(entries), param=""
        )
    return TimeCursor(
        position=here, at_s=at_s, begin_s=begin_s, end_s=end_s, place=place, count=len(entries), param=param
    )
