"""Keeps the alerts of this installation folded and up to date with the log. Writes nothing."""

from collections.abc import Sequence
from threading import Lock

from harness.contracts.errors import UnknownName
from harness.contracts.ids import StreamId
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import because
from harness.projections.alerts import Alert
from harness.runtime import Runtime

PREFIX = "alert/"
BATCH = 2000


class Alerts:
    """The alerts, safe between threads: an answer includes everything committed before the call."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._known: dict[str, Alert] = {}
        self._position = -1
        self._lock = Lock()

    def all(self) -> list[tuple[str, Alert]]:
        """(id, alert), what happened last first."""
        with self._lock:
            self._follow()
            found = list(self._known.items())
        return sorted(found, key=lambda one: -one[1].last_s)

    def one(self, alert_id: str) -> Alert:
        """Raises UnknownName."""
        with self._lock:
            self._follow()
            if alert_id not in self._known:
                raise UnknownName(because("unknown_alert", alert_id=alert_id[:40]))
            return self._known[alert_id]

    def _follow(self) -> None:
        if self._position < 0:
            self._position = self._runtime.head().position
            self._fold(self._runtime.streams(PREFIX))
        while self._position < self._runtime.head().position:
            fresh = self._runtime.log(self._position, BATCH)
            if not fresh:
                return
            self._fold(_streams(fresh))
            self._position = fresh[-1].position

    def _fold(self, streams: Sequence[StreamId]) -> None:
        for stream in streams:
            self._known[stream.removeprefix(PREFIX)] = self._runtime.fold(stream)


def _streams(events: Sequence[StoredEvent]) -> list[StreamId]:
    return list(dict.fromkeys(one.stream for one in events if one.stream.startswith(PREFIX)))
