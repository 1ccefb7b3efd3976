"""Tracks who has which page open, from the event streams that pages hold open."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from threading import Lock


class Presence:
    """Open pages by person and topic. Nothing is stored; whoever closes the page is gone."""

    def __init__(self) -> None:
        self._open: dict[int, tuple[str, frozenset[str]]] = {}
        self._numbers = count()
        self._lock = Lock()

    @contextmanager
    def here(self, name: str, topics: tuple[str, ...]) -> Iterator[None]:
        """Count this person as a viewer of these topics while the block runs."""
        number = next(self._numbers)
        with self._lock:
            self._open[number] = (name, frozenset(topics))
        try:
            yield
        finally:
            with self._lock:
                self._open.pop(number, None)

    def people(self) -> tuple[str, ...]:
        """Everybody with a page open, each once."""
        with self._lock:
            return tuple(sorted({name for name, _ in self._open.values()}))

    def watching(self, *topics: str) -> tuple[str, ...]:
        """Everybody with a page open that listens to one of these topics by its whole name."""
        asked_topics = frozenset(topics)
        with self._lock:
            return tuple(sorted({name for name, topic_set in self._open.values() if topic_set & asked_topics}))
