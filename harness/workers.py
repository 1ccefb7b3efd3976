"""A worker thread that repeats one step, with a pause before each, until it is closed."""

from collections.abc import Callable
from logging import getLogger
from threading import Event, Thread

from harness.contracts.errors import HarnessError

LOG = getLogger(__name__)


class Worker:
    """Calls `step` every `every_s`. A step that raises a HarnessError is logged, and the next one follows."""

    def __init__(self, name: str, step: Callable[[], object], *, every_s: float, close_within_s: float = 5.0) -> None:
        """`close_within_s`: how long `close` waits for a step under way; the thread is a daemon and stops no exit."""
        self._name, self._step = name, step
        self._every_s, self._close_within_s = every_s, close_within_s
        self._halt = Event()
        self._thread: Thread | None = None

    @property
    def started(self) -> bool:
        """Whether `start` was called."""
        return self._thread is not None

    @property
    def closed(self) -> bool:
        """Whether `close` was called: a long step ends early."""
        return self._halt.is_set()

    def start(self) -> None:
        """Run in the background from now on. No effect the second time."""
        if self._thread is None:
            self._thread = Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def wait(self, seconds: float) -> bool:
        """Pause within a step; True as soon as the worker is closed. Works without the thread."""
        return self._halt.wait(seconds)

    def close(self) -> None:
        """End the thread after the current step. No effect the second time."""
        self._halt.set()
        if self._thread is not None:
            self._thread.join(timeout=self._close_within_s)

    def _run(self) -> None:
        while not self._halt.wait(self._every_s):
            try:
                self._step()
            except HarnessError as error:
                LOG.warning("step_failed worker=%s code=%s %s", self._name, error.code, error)


class Background:
    """What repeats a step in the background from `watch` until `close`, by the worker that it makes for itself."""

    _worker: Worker

    def watch(self) -> None:
        """Begin. No effect the second time."""
        self._worker.start()

    def close(self) -> None:
        """End after the step under way. No effect the second time."""
        self._worker.close()
