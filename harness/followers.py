"""The one catch-up loop over the log for everything derived from it: lists, memory, alerts, the release service."""

from collections.abc import Callable, Sequence
from typing import Protocol

from harness.contracts.errors import ConcurrencyConflict
from harness.contracts.ids import Digest
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import LogHead, StoredEvent

BATCH = 1000


class CatchUpTarget(Protocol):
    """Something derived from the log, and how far it has followed it."""

    def mark(self) -> FollowPosition:
        """How far it has followed the log, and with which fold."""
        ...

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Apply the events between two marks, and move the mark to `upto`.

        Raises ConcurrencyConflict if the mark is no longer `after`: the follower then reads the mark again.
        """
        ...

    def clear(self) -> None:
        """Delete everything: it was derived from another log or by another fold."""
        ...


class Follower:
    """Brings one target to the head of the log, in batches, starting at the target's own mark.

    The event at the mark is read again with each batch: if it is not the one the mark names, everything is rebuilt. The
    follower itself holds no state, so it is as safe between threads and processes as its target.
    """

    def __init__(
        self,
        target: CatchUpTarget,
        *,
        head: Callable[[], LogHead],
        read: Callable[[int, int], Sequence[StoredEvent]],
        fold: str,
        batch: int = BATCH,
    ) -> None:
        """`read` returns at most so many events after a position; `fold` names the fold and its version."""
        self._target, self._head, self._read, self._fold, self._batch = target, head, read, fold, batch

    def catch_up(self) -> FollowPosition:
        """Follow to the current head of the log; returns the mark there. Raises what reading and applying raise."""
        while True:
            mark = self._target.mark()
            if mark.position and mark == self.mark_at(self._head()):
                return mark
            events = self._read(max(mark.position - 1, 0), self._batch)
            if mark.position and not self._anchored(mark, events):
                self._target.clear()
                continue
            fresh = events[1:] if mark.position else events
            if not fresh:
                return mark
            try:
                self._target.take(fresh, after=mark, upto=self.mark_at(fresh[-1]))
            except ConcurrencyConflict:
                continue

    def mark_at(self, place: LogHead | StoredEvent) -> FollowPosition:
        """The mark of this fold at an event, or at the head of the log."""
        return FollowPosition(fold=self._fold, position=place.position, digest=place.digest)

    def _anchored(self, mark: FollowPosition, events: Sequence[StoredEvent]) -> bool:
        """Whether the target was derived with this fold and from the current log."""
        return bool(events) and mark == self.mark_at(events[0])


def beginning(fold: str) -> FollowPosition:
    """The mark of a target that has followed nothing yet."""
    return FollowPosition(fold=fold, position=0, digest=Digest(""))
