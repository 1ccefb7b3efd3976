"""Tracks the missions that are still open by following the log, so that finding them does not read its whole
history."""

from collections.abc import Sequence

from harness.contracts.errors import ConcurrencyConflict
from harness.contracts.ids import StreamId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import MISSION_ENDED, MISSION_STREAMS, EventStore, StoredEvent
from harness.contracts.reasons import because
from harness.followers import Follower

FOLD = "open-missions"


class OpenMissions:
    """The streams of open missions. The whole log is read once; afterwards only what was appended since.

    Thread-safe: the state is replaced as one, by whoever read furthest.
    """

    def __init__(self, store: EventStore) -> None:
        self._store = store
        self._known: tuple[FollowPosition, tuple[StreamId, ...]] | None = None
        self._follower = Follower(self, head=store.head, read=store.read, fold=FOLD)

    def streams(self) -> tuple[StreamId, ...]:
        """Open streams by first position, as of now. Raises StoreUnavailable."""
        self._follower.catch_up()
        return self._known_missions()[1]

    def mark(self) -> FollowPosition:
        """How far the log was followed; before the first query, its head."""
        return self._known_missions()[0]

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Add missions that began and remove those that ended."""
        mark, streams = self._known_missions()
        if mark != after:
            raise ConcurrencyConflict(because("fold_taken"), where=FOLD)
        found = dict.fromkeys(streams)
        for event in fresh:
            _follow(found, event)
        self._known = upto, tuple(found)

    def clear(self) -> None:
        """Read the whole log again."""
        self._known = None

    def _known_missions(self) -> tuple[FollowPosition, tuple[StreamId, ...]]:
        known = self._known
        if known is None:
            mark = self._follower.mark_at(self._store.head())
            self._known = known = mark, tuple(self._store.open_missions())
        return known


def _follow(found: dict[StreamId, None], event: StoredEvent) -> None:
    if not event.stream.startswith(MISSION_STREAMS):
        return
    if event.kind == MISSION_ENDED:
        found.pop(event.stream, None)
    elif event.version == 1:
        found[event.stream] = None
