"""Named points at which this process kills itself with SIGKILL, so that crash tests reach every durable boundary.

A name is WHEN:WHAT or WHEN:WHAT#N. WHEN is `before` or `after`; WHAT is an event kind (an append that holds such
an event, such as `after:DispatchIntended`) or a provider's act (`start`, `report`, `find`, `keepalive`, `resume`,
`stop`); N is the occurrence, 1 by default. Without a name the port itself is returned, at no cost.
"""

import os
import re
import signal
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from threading import Lock
from typing import Literal, TypeVar

from harness.contracts import ports
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest, RequestId, StreamId
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.contracts.reasons import because
from harness.contracts.upcasting import name_of
from harness.contracts.values import Moment, Value

Answer = TypeVar("Answer")

_ACTS = ("start", "report", "find", "keepalive", "resume", "stop")
_NAME = re.compile(r"(before|after):([A-Za-z][A-Za-z]{1,63})(?:#([1-9][0-9]{0,5}))?")


class Failpoint(Value):
    """Die `when` the `nth` append of a `what` event, or provider act, is about to be done or is done."""

    when: Literal["before", "after"]
    what: str
    nth: int = 1


def parse(name: str) -> Failpoint:
    """The failpoint of that name; raises UnknownName for one that could never be reached."""
    match = _NAME.fullmatch(name)
    if match is None or not (match[2] in _ACTS or match[2][0].isupper()):
        raise UnknownName(
            because("unknown_failpoint", name=name[:80], acts=tuple(_ACTS)),
            where="REGEN_FAILPOINT",
        )
    return Failpoint(when="before" if match[1] == "before" else "after", what=match[2], nth=int(match[3] or 1))


def with_failpoint(store: ports.EventStore, plan: Failpoint | None) -> ports.EventStore:
    """Wraps `store` if the failpoint is at an append; otherwise returns it."""
    return FailpointStore(store, plan) if plan and plan.what not in _ACTS else store


def provider_with_failpoint(provider: ports.Provider, plan: Failpoint | None) -> ports.Provider:
    """Wraps `provider` if the failpoint is at a provider's act. Each provider counts separately."""
    return FailpointProvider(provider, plan) if plan and plan.what in _ACTS else provider


class _Trigger:
    """Counts occurrences and kills the process at the planned one."""

    def __init__(self, plan: Failpoint) -> None:
        self._plan = plan
        self._lock = Lock()
        self._seen = 0

    def around(self, act: Callable[[], Answer], *, occurs: bool) -> Answer:
        struck = occurs and self._is_the_one()
        if struck and self._plan.when == "before":
            _die()
        answer = act()
        if struck:
            _die()
        return answer

    def _is_the_one(self) -> bool:
        with self._lock:
            self._seen += 1
            return self._seen == self._plan.nth


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


class FailpointStore:
    """An event store that kills the process at one append. Everything else is passed through."""

    def __init__(self, store: ports.EventStore, plan: Failpoint) -> None:
        self._store = store
        self._what = plan.what
        self._trigger = _Trigger(plan)

    def append(self, batches: Sequence[ports.Batch], records: Sequence[ports.Record], now: Moment) -> ports.LogHead:
        """The store's append; a refused one counts as an occurrence too."""
        occurs = any(name_of(event.kind) == self._what for batch in batches for event in batch.events)
        return self._trigger.around(lambda: self._store.append(batches, records, now), occurs=occurs)

    def turn(self) -> AbstractContextManager[None]:
        return self._store.turn()

    def load(self, stream: StreamId, after: int = 0) -> list[ports.StoredEvent]:
        return self._store.load(stream, after)

    def read(self, after: int = 0, limit: int = 1000) -> list[ports.StoredEvent]:
        return self._store.read(after, limit)

    def streams(self, prefix: str) -> list[StreamId]:
        return self._store.streams(prefix)

    def open_missions(self) -> list[StreamId]:
        return self._store.open_missions()

    def ended_missions(self, after: int, upto: int) -> list[StreamId]:
        return self._store.ended_missions(after, upto)

    def record(self, digest: Digest) -> ports.Record:
        return self._store.record(digest)

    def head(self) -> ports.LogHead:
        return self._store.head()

    def verify(self) -> ports.LogHead:
        return self._store.verify()

    def close(self) -> None:
        self._store.close()


class FailpointProvider:
    """A provider that kills the process at one act."""

    def __init__(self, provider: ports.Provider, plan: Failpoint) -> None:
        self._provider = provider
        self._what = plan.what
        self._trigger = _Trigger(plan)

    @property
    def card(self) -> CapabilityCard:
        return self._provider.card

    def start(self, request: StartRequest) -> InvocationReport:
        return self._around("start", lambda: self._provider.start(request))

    def report(self, handle: str) -> InvocationReport:
        return self._around("report", lambda: self._provider.report(handle))

    def find(self, request: RequestId) -> InvocationReport | None:
        return self._around("find", lambda: self._provider.find(request))

    def keepalive(self, handle: str) -> None:
        self._around("keepalive", lambda: self._provider.keepalive(handle))

    def resume(self, handle: str) -> InvocationReport:
        return self._around("resume", lambda: self._provider.resume(handle))

    def stop(self, handle: str) -> InvocationReport:
        return self._around("stop", lambda: self._provider.stop(handle))

    def _around(self, act: str, call: Callable[[], Answer]) -> Answer:
        return self._trigger.around(call, occurs=act == self._what)
