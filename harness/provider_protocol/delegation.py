"""A provider that passes every call on to another: what stands between the two overrides what it changes."""

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import RequestId
from harness.contracts.ports import Provider
from harness.contracts.protocol import InvocationReport, StartRequest


class DelegatingProvider:
    """Implements `contracts.ports.Provider` by `inner`."""

    def __init__(self, inner: Provider) -> None:
        self.inner = inner

    @property
    def card(self) -> CapabilityCard:
        return self.inner.card

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.start(request)

    def report(self, handle: str) -> InvocationReport:
        return self.inner.report(handle)

    def find(self, request: RequestId) -> InvocationReport | None:
        return self.inner.find(request)

    def keepalive(self, handle: str) -> None:
        self.inner.keepalive(handle)

    def resume(self, handle: str) -> InvocationReport:
        return self.inner.resume(handle)

    def stop(self, handle: str) -> InvocationReport:
        return self.inner.stop(handle)
