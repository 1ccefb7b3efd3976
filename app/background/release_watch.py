"""Follows the log for the release service: records ended canary missions and applies the pointer in this console."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from harness.contracts.ids import MissionId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import LogHead, StoredEvent
from harness.followers import Follower, beginning
from harness.workers import Background, Worker
from rsi_reviews.release_service import ReleaseService

STEP_S = 1.0
FOLD = "releases"
WORKER = "console"


@dataclass
class ReleaseWatch(Background):
    """`step` looks once; `watch` does so again and again. `head` is the log's end, `first` is done once before.

    `duplicate_starts`: physical starts beyond the first of one request, from the robots' own journals. What the log
    holds already when this begins is looked at once, as a whole; from then on only what was appended since is read.
    """

    releases: ReleaseService
    head: Callable[[], LogHead]
    read: Callable[[int, int], Sequence[StoredEvent]]
    duplicate_starts: Callable[[MissionId], int]
    first: Callable[[], object] | None = None
    _mark: FollowPosition | None = None
    _follower: Follower = field(init=False)

    def __post_init__(self) -> None:
        self._worker = Worker("release-watch", self._follow_new, every_s=STEP_S)
        self._follower = Follower(self, head=self.head, read=self.read, fold=FOLD)

    def step(self) -> None:
        """Follow the log; does nothing unless it has grown."""
        self._follower.catch_up()

    def mark(self) -> FollowPosition:
        """How far the log was followed; before the first look, whatever it holds is looked at as a whole."""
        if self._mark is None:
            head = self.head()
            self._look()
            self._mark = self._follower.mark_at(head) if head.position else beginning(FOLD)
        return self._mark

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """The log has grown: look again."""
        self._look()
        self._mark = upto

    def clear(self) -> None:
        """Look at the log as a whole again."""
        self._mark = None

    def _look(self) -> None:
        self.releases.take_up(WORKER)
        self.releases.catch_up(self.duplicate_starts)

    def _follow_new(self) -> None:
        first, self.first = self.first, None
        if first is not None:
            first()
        self.step()
