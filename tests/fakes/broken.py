"""Provides one broken provider for each row of the conformance kit: it keeps every promise of the protocol but
that one.
"""

from dataclasses import replace as reissued

from msgspec import UNSET
from msgspec.structs import replace

from harness.conformance.subject import ProviderUnderTest
from harness.contracts.ids import Digest, MissionId, NodeId, RequestId, request_id
from harness.contracts.ports import Clock, Provider
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.contracts.values import Moment
from tests.fakes.passing import Passing


class Unversioned(Passing):
    """card_complete: the card declares no failure words."""

    def __init__(self, inner: Provider) -> None:
        super().__init__(inner, failure_words=())


class Failing(Passing):
    """completes: whatever succeeded is reported as failed."""

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        return replace(said, status="failed", failure="timeout") if said.status == "succeeded" else said


class Restarting(Passing):
    """idempotent_start: every start is an execution of its own."""

    def start(self, request: StartRequest) -> InvocationReport:
        self.times = getattr(self, "times", 0) + 1
        another = request_id(MissionId("other"), NodeId(request.identity.node_id), self.times)
        return self.inner.start(replace(request, identity=replace(request.identity, request_id=another)))


class Careless(Passing):
    """other_parameters_refused: a known request id is enough."""

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.find(request.identity.request_id) or self.inner.start(request)


class Greedy(Passing):
    """unfit_request_refused: parameters that are not on the card are dropped and the rest is executed."""

    def start(self, request: StartRequest) -> InvocationReport:
        known = {parameter.name for parameter in self.card.parameters}
        fit = {name: value for name, value in request.parameters.items() if name in known}
        return self.inner.start(replace(request, parameters=fit))


class Lost(Passing):
    """found_by_request: no request is ever found."""

    def find(self, request: RequestId) -> InvocationReport | None:
        return None


class Polite(Passing):
    """unknown_handle: an unknown handle is accepted as alive."""

    def keepalive(self, handle: str) -> None:
        if handle != "no-such-handle":
            super().keepalive(handle)


class Unfenced(Passing):
    """fencing: every token is the newest."""

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.start(replace(request, fencing=dict.fromkeys(request.fencing, 99)))


class Unleased(Passing):
    """lease_required: takes the resources it was not given."""

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.start(replace(request, fencing=dict.fromkeys(self.card.resources, 1) | request.fencing))


class Hasty(Passing):
    """acknowledged_stop: reports cancelled before standstill."""

    def stop(self, handle: str) -> InvocationReport:
        return replace(super().stop(handle), status="cancelled")


class Reviving(Passing):
    """stop_is_final: a resume brings back what was cancelled."""

    def __init__(self, inner: Provider) -> None:
        super().__init__(inner)
        self.revived = False

    def resume(self, handle: str) -> InvocationReport:
        self.revived = self.inner.report(handle).status == "cancelled"
        return super().resume(handle)

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        return replace(said, status="running") if self.revived else said


class Timeless(Passing):
    """deadline: no deadline is ever too late."""

    def start(self, request: StartRequest) -> InvocationReport:
        return self.inner.start(replace(request, deadline_s=request.deadline_s + 600.0))


class Immovable(Passing):
    """resume: a resume is acknowledged and not executed."""

    def resume(self, handle: str) -> InvocationReport:
        return self.inner.report(handle)


class Forgetting(Passing):
    """late_repeat: the final report changes at each request."""

    def __init__(self, inner: Provider) -> None:
        super().__init__(inner)
        self.asked = 0

    def report(self, handle: str) -> InvocationReport:
        self.asked += 1
        return replace(super().report(handle), message=f"asked {self.asked} times")


class Unproven(Passing):
    """evidence_promised: the receipts are missing."""

    def report(self, handle: str) -> InvocationReport:
        return replace(super().report(handle), receipts=())


class Borrowing(Passing):
    """receipts_bound: receipts of another request."""

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        strange = tuple(replace(receipt, request_id=RequestId("e" * 64)) for receipt in said.receipts)
        return replace(said, receipts=strange)


class Silent(Passing):
    """proposes_facts: what it did is reported, and nothing of it proposed."""

    def report(self, handle: str) -> InvocationReport:
        return replace(super().report(handle), proposed_facts=())


class Elsewhere(Passing):
    """proposes_facts: the arrival that it proposes is at another target than the request's."""

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        moved = tuple(replace(one, arguments={**one.arguments, "target_m": (9.0, 9.0)}) for one in said.proposed_facts)
        return replace(said, proposed_facts=moved)


class Earlier(Passing):
    """proposes_facts: a provider of protocol 1.0, which knows of no proposals."""

    def __init__(self, inner: Provider) -> None:
        super().__init__(inner, protocol="1.0")

    def start(self, request: StartRequest) -> InvocationReport:
        assert request.intended is UNSET, "a provider of protocol 1.0 is sent nothing that it does not know"
        return replace(self.inner.start(request), proposed_facts=())


class Inventive(Passing):
    """failure_words: a failure word that is not on the card."""

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        return replace(said, failure="gremlins") if said.status == "failed" else said


class Boasting(Passing):
    """progress: more than 100 %, then less."""

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        running = said.status == "running"
        return replace(said, progress=replace(said.progress, share=1.5)) if running else said


class Confused(Passing):
    """identity_echo: reports another mission."""

    def report(self, handle: str) -> InvocationReport:
        said = super().report(handle)
        return replace(said, identity=replace(said.identity, mission_id=MissionId("another")))


class Tireless:
    """dead_man: a clock by which the provider keeps itself alive without a supervisor."""

    def __init__(self, clock: Clock, provider: "Remembering") -> None:
        self._clock, self._provider = clock, provider

    def now(self) -> Moment:
        return self._clock.now()

    def wait_until(self, mission_s: float) -> None:
        while self.now().mission_s < mission_s - 1e-6:
            self._clock.wait_until(min(mission_s, self.now().mission_s + 0.5))
            for handle in self._provider.handles:
                self._provider.inner.keepalive(handle)


class Remembering(Passing):
    """Records every handle it returned."""

    def __init__(self, inner: Provider) -> None:
        super().__init__(inner)
        self.handles: list[str] = []

    def start(self, request: StartRequest) -> InvocationReport:
        said = super().start(request)
        self.handles.append(said.handle)
        return said


def tireless(subject: ProviderUnderTest) -> ProviderUnderTest:
    provider = Remembering(subject.provider)
    return reissued(subject, provider=provider, clock=Tireless(subject.clock, provider))


def forgotten(subject: ProviderUnderTest) -> ProviderUnderTest:
    """reattach: after a restart of the supervisor nobody knows the request."""
    return reissued(subject, reattached=lambda: Lost(subject.provider))


def falsified(subject: ProviderUnderTest) -> ProviderUnderTest:
    """evidence_promised: bytes that do not match the digest they are fetched by."""

    def other(digest: Digest) -> bytes:
        return subject.blob(digest) + b"!"

    return reissued(subject, blob=other)
