"""Failpoints that are not placed cost nothing; those that are strike where their name says."""

import pytest

from harness.adapters.failpoints import (
    Failpoint,
    FailpointProvider,
    FailpointStore,
    parse,
    provider_with_failpoint,
    with_failpoint,
)
from harness.adapters.stores.memory import MemoryEventStore
from harness.contracts.capabilities import CancelBehaviour, CapabilityCard, Estimates, Latency
from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId, NodeId, ProviderId, RequestId, StreamId
from harness.contracts.protocol import InvocationIdentity, InvocationReport, Progress, StartRequest
from tests.saying import raises_saying
from tests.unit.stores.builders import NOW, batch, record
from tests.unit.stores.processes import running

IDENTITY = InvocationIdentity(
    mission_id=MissionId("msn_1"),
    node_id=NodeId("outbound"),
    attempt=1,
    request_id=RequestId("r"),
    provider_id=ProviderId("fake"),
)
REPORT = InvocationReport(handle="h", identity=IDENTITY, status="running", at_s=1.0, progress=Progress(share=0.0))
REQUEST = StartRequest(
    identity=IDENTITY, capability="observe", parameters={}, k_ctx=1, configuration="c", deadline_s=9.0, fencing={}
)


class FakeProvider:
    """Writes down what it is asked, and answers."""

    card = CapabilityCard(
        provider_id=ProviderId("fake"),
        version="1",
        embodiments=(),
        parameters=(),
        preconditions=(),
        side_effects=(),
        latency=Latency(base_s=0.0),
        resources=(),
        cancel=CancelBehaviour(acknowledged=True, within_s=1.0),
        risk="low",
        failure_words=(),
        evidence=(),
        capability="observe",
        estimates=Estimates(success=1.0, risk=0.0, uncertainty=0.0, cost=0.0),
        moves=False,
    )

    def __init__(self) -> None:
        self.asked: list[object] = []

    def start(self, request: StartRequest) -> InvocationReport:
        return self._answer("start", request)

    def report(self, handle: str) -> InvocationReport:
        return self._answer("report", handle)

    def find(self, request: RequestId) -> InvocationReport | None:
        return self._answer("find", request)

    def keepalive(self, handle: str) -> None:
        self._answer("keepalive", handle)

    def resume(self, handle: str) -> InvocationReport:
        return self._answer("resume", handle)

    def stop(self, handle: str) -> InvocationReport:
        return self._answer("stop", handle)

    def _answer(self, act: str, argument: object) -> InvocationReport:
        self.asked.append((act, argument))
        return REPORT


def test_names_say_when_what_and_which_time() -> None:
    assert parse("before:NodeCommitted") == Failpoint(when="before", what="NodeCommitted", nth=1)
    assert parse("after:start#3") == Failpoint(when="after", what="start", nth=3)


@pytest.mark.parametrize(
    "name",
    ["", "NodeCommitted", "during:start", "before:", "before:launch", "after:stop#0", "after:stop#", "before:stop\n"],
)
def test_a_name_that_could_never_strike_is_refused(name: str) -> None:
    with raises_saying(UnknownName, match="before: or after:"):
        parse(name)


def test_without_a_plan_the_ports_are_returned_as_they_are() -> None:
    store, provider = MemoryEventStore(), FakeProvider()
    assert with_failpoint(store, None) is store
    assert provider_with_failpoint(provider, None) is provider
    assert with_failpoint(store, parse("before:start")) is store
    assert provider_with_failpoint(provider, parse("before:NodeCommitted")) is provider


def test_a_store_whose_failpoint_is_not_reached_is_a_store_like_any_other() -> None:
    store = MemoryEventStore()
    guarded = with_failpoint(store, parse("before:NodeCommitted#2"))
    assert isinstance(guarded, FailpointStore)
    context = record("context", {"role": "planner"})
    head = guarded.append([batch("mission/a", 0, "NodeCommitted")], [context], NOW)
    assert head == guarded.head() == guarded.verify() == store.head()
    assert guarded.load(StreamId("mission/a")) == guarded.read() == store.read()
    assert guarded.streams("mission/") == ["mission/a"]
    assert guarded.record(context.digest) == context
    guarded.close()


def test_a_provider_whose_failpoint_is_not_reached_is_a_provider_like_any_other() -> None:
    provider = FakeProvider()
    guarded = provider_with_failpoint(provider, parse("after:stop#2"))
    assert isinstance(guarded, FailpointProvider)
    answers = [guarded.start(REQUEST), guarded.report("h"), guarded.find(RequestId("r")), guarded.resume("h")]
    answers.append(guarded.stop("h"))
    guarded.keepalive("h")
    assert answers == [REPORT] * 5
    assert guarded.card is provider.card
    assert provider.asked == [
        ("start", REQUEST),
        ("report", "h"),
        ("find", "r"),
        ("resume", "h"),
        ("stop", "h"),
        ("keepalive", "h"),
    ]


@pytest.mark.parametrize(("failpoint", "printed"), [("before:start#2", "1"), ("after:start#2", "1 2")])
def test_a_provider_failpoint_kills_before_or_after_the_provider_was_asked(failpoint: str, printed: str) -> None:
    with running("dispatch", failpoint) as child:
        assert child.stdout is not None
        assert " ".join(child.stdout.read().split()) == printed
        assert child.wait(timeout=60) == -9
