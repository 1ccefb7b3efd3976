"""One catch-up loop over the log for everything that is made from it: lists, memory, alerts, the release service."""

from collections.abc import Callable, Sequence
from typing import Protocol

from harness.contracts.errors import ConcurrencyConflict
from harness.contracts.ids import Digest
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import LogHead, StoredEvent

BATCH = 1000


class CatchUpTarget(Protocol):
    """What is made from the log, and how far."""

    def mark(self) -> FollowPosition:
        """How far this has followed the log, and by which fold."""
        ...

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Take in the events between two marks, and stand at `upto` afterwards.

        Raises ConcurrencyConflict if it no longer stands at `after`: the follower then asks for the mark again.
        """
        ...

    def clear(self) -> None:
        """Forget everything: it was made of another log or by another fold."""
        ...


class Follower:
    """Brings one thing to the head of the log, a stretch at a time, from where its own mark stands.

    The event at the mark is read again with each stretch: if it is not the one the mark names, everything is made anew.
    The follower itself holds nothing, so it is as safe between threads and processes as what it brings along.
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
        """`read` gives at most so many events behind a position; `fold` names what is made of them, and how."""
        self._target, self._head, self._read, self._fold, self._batch = target, head, read, fold, batch

    def catch_up(self) -> FollowPosition:
        """Follow to the head of the log as it is now; the mark there. Raises what reading and taking in raise."""
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
        """Whether what was made so far is of this fold and of the log as it is now."""
        return bool(events) and mark == self.mark_at(events[0])


def beginning(fold: str) -> FollowPosition:
    """The mark of what has followed nothing yet."""
    return FollowPosition(fold=fold, position=0, digest=Digest(""))
