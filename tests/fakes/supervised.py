"""Provides providers that answer late, twice, never, or ignore a stop, as a supervisor meets them on a real network."""

from msgspec.structs import replace

from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import RequestId
from harness.contracts.ports import Provider
from harness.contracts.protocol import InvocationReport, StartRequest
from tests.fakes.passing import Passing


def gone(what: str) -> ProviderUnreachable:
    return ProviderUnreachable(what, where="the network", do="ask again")


class LostAcknowledgement(Passing):
    """The first start arrives; its answer does not."""

    sent = 0

    def start(self, request: StartRequest) -> InvocationReport:
        self.sent += 1
        answered = self.inner.start(request)
        if self.sent == 1:
            raise gone("the answer to a start was lost")
        return answered


class LateStart(Passing):
    """The first start is delayed and arrives after the supervisor asked for it, but before the one sent instead
    of it.
    """

    sent = 0
    under_way: StartRequest | None = None

    def start(self, request: StartRequest) -> InvocationReport:
        self.sent += 1
        if self.sent == 1:
            self.under_way = request
            raise gone("the start timed out")
        return self.inner.start(request)

    def find(self, request: RequestId) -> InvocationReport | None:
        found = self.inner.find(request)
        if self.under_way is not None and self.under_way.identity.request_id == request:
            self.inner.start(self.under_way)
            self.under_way = None
        return found


class Twice(Passing):
    """Every start is sent twice, and every query too."""

    def start(self, request: StartRequest) -> InvocationReport:
        self.inner.start(request)
        return self.inner.start(request)

    def report(self, handle: str) -> InvocationReport:
        self.inner.report(handle)
        return self.inner.report(handle)


class Deaf(Passing):
    """A stop is acknowledged and not executed."""

    def stop(self, handle: str) -> InvocationReport:
        return self.inner.report(handle)


class Runaway(Deaf):
    """Ignores stops, and keeps itself alive whenever the supervisor only reads its status."""

    def report(self, handle: str) -> InvocationReport:
        self.inner.keepalive(handle)
        return self.inner.report(handle)


class Stubborn(Deaf):
    """Ignores stops and deadlines."""

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.start(replace(request, deadline_s=request.deadline_s + 600.0))


class Line:
    """A network connection that the test cuts and restores."""

    cut = False

    def check(self) -> None:
        if self.cut:
            raise gone("the line is cut")


class Remote(Passing):
    """A provider behind a connection: while it is cut nothing arrives and nothing returns. `calls`: what got
    through.
    """

    def __init__(self, inner: Provider, line: Line, **card: object) -> None:
        super().__init__(inner, **card)
        self._line = line
        self.calls: list[str] = []

    def start(self, request: StartRequest) -> InvocationReport:
        self._through("start")
        return self.inner.start(request)

    def report(self, handle: str) -> InvocationReport:
        self._through("report")
        return self.inner.report(handle)

    def find(self, request: RequestId) -> InvocationReport | None:
        self._through("find")
        return self.inner.find(request)

    def keepalive(self, handle: str) -> None:
        self._through("keepalive")
        self.inner.keepalive(handle)

    def resume(self, handle: str) -> InvocationReport:
        self._through("resume")
        return self.inner.resume(handle)

    def stop(self, handle: str) -> InvocationReport:
        self._through("stop")
        return self.inner.stop(handle)

    def _through(self, name: str) -> None:
        self._line.check()
        self.calls.append(name)
