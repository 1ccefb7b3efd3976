"""The SQL log when its process is killed, when two processes append, and when the disk is full."""

from pathlib import Path

import pytest

from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.capabilities import CancelBehaviour, CapabilityCard, Estimates, Latency
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import MissionId, NodeId, ProviderId, RequestId, StreamId, sha256
from harness.contracts.ports import Batch, NewEvent, Record
from harness.contracts.protocol import InvocationIdentity, InvocationReport, Progress
from harness.contracts.tasks import Goal
from harness.contracts.values import Value, decode, encode
from tests.unit.stores.builders import NOW, batch, record
from tests.unit.stores.processes import kill, lines, running


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'events.db'}"


@pytest.mark.parametrize("acknowledged", [1, 200])
def test_a_killed_writer_leaves_every_acknowledged_append_on_an_intact_chain(url: str, acknowledged: int) -> None:
    with running("burst", url) as child:
        seen = lines(child, acknowledged)
        seen += kill(child)
    last = int(seen[-1])
    assert [int(position) for position in seen] == list(range(2, last + 1, 2))
    store = SqlEventStore(url)
    head = store.verify()
    # One more append may have reached the disk without its acknowledgement reaching us; never half of it.
    assert head.position in (last, last + 2)
    log = store.read(limit=head.position)
    assert [event.stream for event in log] == ["mission/a", "lease/base"] * (head.position // 2)
    assert store.append([batch("mission/a", head.position // 2, "Resumed")], [], NOW).position == head.position + 1
    store.close()


def test_of_two_processes_exactly_one_wins_each_version(url: str) -> None:
    rounds = 150
    SqlEventStore(url).close()
    with running("race", url, "mission/a", str(rounds)) as one, running("race", url, "mission/a", str(rounds)) as other:
        wins = [int(lines(child, 1)[0]) for child in (one, other)]
    assert sum(wins) == rounds
    store = SqlEventStore(url)
    assert [event.version for event in store.load(StreamId("mission/a"))] == list(range(1, rounds + 1))
    assert store.verify().position == rounds
    store.close()


def test_two_processes_may_create_the_same_log_at_once(url: str) -> None:
    with running("race", url, "mission/a", "20") as one, running("race", url, "mission/a", "20") as other:
        wins = [int(lines(child, 1)[0]) for child in (one, other)]
    assert sum(wins) == 20


def test_a_full_disk_is_said_and_costs_nothing_that_was_acknowledged(url: str, tmp_path: Path) -> None:
    with running("fill", url, "300000") as child:
        *acknowledged, complaint = lines(child, 1000)
    assert "The event log cannot be used" in complaint
    assert str(tmp_path / "events.db") in complaint
    assert "everything acknowledged before is intact" in complaint
    store = SqlEventStore(url)
    assert len(acknowledged) > 3
    assert store.verify().position == len(acknowledged)
    assert store.append([batch("mission/b", 0, "Resumed")], [], NOW).position == len(acknowledged) + 1
    store.close()


@pytest.mark.parametrize(
    ("failpoint", "kept"), [("before:Dispatched", ["Asked"]), ("after:Dispatched", ["Asked", "Dispatched"])]
)
def test_a_failpoint_kills_before_or_after_the_append_is_durable(url: str, failpoint: str, kept: list[str]) -> None:
    with running("fail", url, failpoint) as child:
        assert child.wait(timeout=60) == -9
    store = SqlEventStore(url)
    assert [event.kind for event in store.load(StreamId("mission/a"))] == kept
    assert store.verify().position == len(kept)
    store.close()


def test_a_failpoint_that_is_never_reached_changes_nothing(url: str) -> None:
    with running("fail", url, "after:Dispatched#2") as child:
        assert child.wait(timeout=60) == 0
    store = SqlEventStore(url)
    assert store.head().position == 3
    store.close()


REQUEST = RequestId("r" * 64)
WRITTEN: tuple[Value, ...] = (
    Goal(text="Help me go and check the office storage area", digest=sha256(b"goal")),
    EvidenceReference(
        kind="pose",
        origin="sensor",
        source="localiser",
        from_s=1.0,
        until_s=2.5,
        confidence=0.9,
        blob=sha256(b"trajectory"),
        frame="map",
    ),
    InvocationReport(
        handle="h1",
        identity=InvocationIdentity(
            mission_id=MissionId("msn_1"),
            node_id=NodeId("outbound"),
            attempt=1,
            request_id=REQUEST,
            provider_id=ProviderId("route_follower"),
        ),
        status="running",
        at_s=3.0,
        progress=Progress(share=0.5, remaining_m=8.81),
    ),
    CapabilityCard(
        provider_id=ProviderId("route_follower"),
        version="1",
        embodiments=("quadruped",),
        parameters=(),
        preconditions=(),
        side_effects=("moves",),
        latency=Latency(base_s=1.0),
        resources=(),
        cancel=CancelBehaviour(acknowledged=True, within_s=2.0),
        risk="medium",
        failure_words=("blocked",),
        evidence=("pose",),
        capability="navigate",
        estimates=Estimates(success=0.9, risk=0.1, uncertainty=0.1, cost=1.0),
        moves=True,
    ),
)
"""A task, a piece of evidence, an execution and a semantic memory: the contracts that R149 wants in SQLite."""


@pytest.mark.ledger("R149", symbol="harness.adapters.stores.sql_log:SqlLog.append")
@pytest.mark.ledger("R149", symbol="harness.adapters.stores.sql_log:SqlLog.record")
@pytest.mark.ledger("R149", symbol="harness.adapters.stores.sql_log:SqlLog.load")
def test_task_evidence_execution_and_memory_come_back_from_sqlite_as_the_immutable_values_they_were(url: str) -> None:
    store = SqlEventStore(url)
    artefacts = [record(type(value).__name__, value) for value in WRITTEN]
    events = tuple(NewEvent(kind=type(value).__name__, body=encode(value)) for value in WRITTEN)
    store.append([Batch(stream=StreamId("mission/msn_1"), expected_version=0, events=events)], artefacts, NOW)
    store.close()

    reopened = SqlEventStore(url)
    loaded = reopened.load(StreamId("mission/msn_1"))
    kinds = {type(value).__name__: type(value) for value in WRITTEN}
    assert tuple(decode(event.body, kinds[event.kind]) for event in loaded) == WRITTEN
    for artefact, value in zip(artefacts, WRITTEN, strict=True):
        found: Record = reopened.record(artefact.digest)
        back = decode(found.body, kinds[found.kind])
        assert back == value
        with pytest.raises(AttributeError, match="immutable"):
            setattr(back, type(back).__struct_fields__[0], "changed")
    reopened.close()
