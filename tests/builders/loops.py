"""Provides an event loop whose time passes only while all its tasks wait, so that timings are exact on any machine."""

import asyncio
import selectors
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _Passing(selectors.DefaultSelector):  # type: ignore[misc, valid-type]
    """A selector that advances the time instead of sleeping."""

    now_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:
            return super().select(None)
        ready: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        self.now_s += 0.0 if ready else max(timeout, 0.0)
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """An event loop for tasks that wait for each other and for time alone; nothing may come from other threads."""

    def __init__(self) -> None:
        self._passing = _Passing()
        super().__init__(self._passing)

    def time(self) -> float:
        return self._passing.now_s


def in_virtual_time(story: Coroutine[Any, Any, T]) -> T:
    """The result of the coroutine, run in virtual time."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(story)
