"""Which missions are not over, followed along the log: what a house goes on with must not cost its whole history."""

from collections.abc import Iterable

from harness.contracts.ids import StreamId
from harness.contracts.ports import MISSION_ENDED, MISSION_STREAMS, EventStore, StoredEvent

_PAGE = 1000


class OpenMissions:
    """The streams of open missions. The whole log is asked once; afterwards only what was appended since is read.

    Safe between threads: what is known is replaced as one, by whoever read further.
    """

    def __init__(self, store: EventStore) -> None:
        self._store = store
        self._known: tuple[int, tuple[StreamId, ...]] | None = None

    def streams(self) -> tuple[StreamId, ...]:
        """By first position, as of now. Raises StoreUnavailable."""
        head, known = self._store.head().position, self._known
        if known is None:
            known = (head, tuple(self._store.open_missions()))
        elif known[0] < head:
            known = self._followed(*known)
        self._known = known
        return known[1]

    def _followed(self, position: int, streams: Iterable[StreamId]) -> tuple[int, tuple[StreamId, ...]]:
        found = dict.fromkeys(streams)
        while page := self._store.read(position, _PAGE):
            for event in page:
                _follow(found, event)
            position = page[-1].position
            if len(page) < _PAGE:
                break
        return position, tuple(found)


def _follow(found: dict[StreamId, None], event: StoredEvent) -> None:
    if not event.stream.startswith(MISSION_STREAMS):
        return
    if event.kind == MISSION_ENDED:
        found.pop(event.stream, None)
    elif event.version == 1:
        found[event.stream] = None
