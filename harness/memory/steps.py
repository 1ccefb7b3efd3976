"""Follows missions for folds of memory: the event, and the mission as it was before it. Pure."""

from collections.abc import Callable, Collection

from harness.contracts.decider import Codec
from harness.contracts.events import MissionEvent
from harness.contracts.ids import StreamId
from harness.contracts.ports import StoredEvent
from harness.contracts.upcasting import name_of
from harness.memory.draft import MissionStep
from harness.projections.memory import MissionThread, follow, passed

LoadStream = Callable[[StreamId], list[StoredEvent]]
_codec: Codec[MissionEvent] = Codec(MissionEvent)


class MissionSteps:
    """The open missions of a log that is followed in global order.

    `stream` loads a mission from its beginning, for one that was open before. `kinds`: the only events whose content
    is read; None reads all of them.
    """

    def __init__(self, *, stream: LoadStream, kinds: Collection[str] | None = None) -> None:
        self._stream = stream
        self._kinds = kinds
        self._threads: dict[StreamId, MissionThread] = {}

    def step(self, stored: StoredEvent) -> MissionStep | None:
        """This event on its mission, or None if its content is not read. Raises LogDamaged if it cannot be read."""
        before = self._thread(stored)
        if self._passes(stored):
            self._threads[stored.stream] = passed(before)
            return None
        event = _codec.decode(stored)
        after = follow(before, event)
        if after.ended:
            self._threads.pop(stored.stream, None)
        else:
            self._threads[stored.stream] = after
        return MissionStep(stored=stored, event=event, before=before)

    def clear(self) -> None:
        """Forget every mission: another log is followed."""
        self._threads.clear()

    def is_open(self, stream: StreamId) -> bool:
        """Whether events of this mission were followed and none ended it."""
        return stream in self._threads

    def _thread(self, stored: StoredEvent) -> MissionThread:
        """The mission as it was before this event."""
        thread = self._threads.get(stored.stream, MissionThread())
        if thread.version != stored.version - 1:
            thread = MissionThread()
            for event in self._stream(stored.stream)[: stored.version - 1]:
                thread = passed(thread) if self._passes(event) else follow(thread, _codec.decode(event))
        return thread

    def _passes(self, stored: StoredEvent) -> bool:
        return self._kinds is not None and name_of(stored.kind) not in self._kinds
