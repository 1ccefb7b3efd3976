"""What is kept because it may be asked for again: so many of each kind, and those that nobody asked for longest go."""

from collections import OrderedDict
from contextlib import suppress
from typing import Any, Generic, TypeVar

from harness.contracts.ids import StreamId
from harness.contracts.ports import MISSION_STREAMS

KEPT_MISSIONS = 256
"""Folds of missions: those that go on are asked for all the time; what is over is folded again when somebody looks."""
KEPT_STREAMS = 4096
"""Folds of everything else (leases, questions, reviews), which are small."""
Key = TypeVar("Key")
Item = TypeVar("Item")


class Kept(Generic[Key, Item]):
    """At most `limit` items. Losing one costs making it again and nothing else.

    Safe between threads: whoever comes too late finds the item gone, and no more than that.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._items: OrderedDict[Key, Item] = OrderedDict()

    def __len__(self) -> int:
        return len(self._items)

    def get(self, key: Key) -> Item | None:
        """The item, which then counts as the newest; None if it is not kept."""
        try:
            self._items.move_to_end(key)
            return self._items[key]
        except KeyError:
            return None

    def put(self, key: Key, item: Item) -> None:
        """Keep it as the newest, in the place of what had this key."""
        self._items[key] = item
        with suppress(KeyError):
            self._items.move_to_end(key)
            while len(self._items) > self._limit:
                self._items.popitem(last=False)


class Folds:
    """The state and version of streams as they were last folded."""

    def __init__(self, *, missions: int = KEPT_MISSIONS, others: int = KEPT_STREAMS) -> None:
        self._missions = Kept[StreamId, tuple[Any, int]](missions)
        self._others = Kept[StreamId, tuple[Any, int]](others)

    def __len__(self) -> int:
        return len(self._missions) + len(self._others)

    def get(self, stream: StreamId) -> tuple[Any, int] | None:
        return (self._missions if stream.startswith(MISSION_STREAMS) else self._others).get(stream)

    def put(self, stream: StreamId, state: Any, version: int) -> None:
        (self._missions if stream.startswith(MISSION_STREAMS) else self._others).put(stream, (state, version))
