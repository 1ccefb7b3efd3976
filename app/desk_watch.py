"""Follows the log for the review desk: ended canary missions are taken in, and this console takes a new pointer up."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event, Thread

from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId
from rsi_reviews.desk import Desk

LOG = logging.getLogger(__name__)
STEP_S = 1.0
WORKER = "console"


@dataclass
class DeskWatch:
    """`step` looks once; `watch` does so again and again. `position` is the log's end, `first` is done once before.

    `duplicate_starts`: physical starts beyond the first of one request, from the robots' own journals.
    """

    desk: Desk
    position: Callable[[], int]
    duplicate_starts: Callable[[MissionId], int]
    first: Callable[[], object] | None = None
    _seen: int = -1
    _halt: Event = field(default_factory=Event)
    _thread: Thread | None = None

    def watch(self) -> None:
        """From now on, in the background."""
        self._thread = Thread(target=self._work, name="review-desk", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._halt.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def step(self) -> None:
        """Nothing, unless the log has grown since."""
        head = self.position()
        if head == self._seen:
            return
        self._seen = head
        self.desk.take_up(WORKER)
        self.desk.catch_up(self.duplicate_starts)

    def _work(self) -> None:
        while not self._halt.wait(STEP_S):
            try:
                first, self.first = self.first, None
                if first is not None:
                    first()
                self.step()
            except HarnessError as error:
                LOG.warning("desk_watch_failed code=%s %s", error.code, error)
