"""The gate keeps few folds: what it gives up is folded again, and nobody can tell by what is decided or written."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from threading import Barrier

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.stores.installation_key import InstallationKey
from harness.adapters.stores.log_address import open_log
from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.snapshots import StoredSnapshots
from harness.bootstrap import DECIDERS, simulated
from harness.contracts.commands import (
    AcquireLease,
    ActivateMission,
    JudgeGoal,
    MissionCommand,
    RaiseVeto,
    ReleaseLease,
    StopMission,
)
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import InvocationId, MissionId, ResourceId, StreamId, lease_stream, mission_stream
from harness.contracts.ports import EventStore, Snapshots, State, StoredEvent
from harness.contracts.values import encode
from harness.gate.aggregate_cache import KEPT_MISSIONS, AggregateCache
from harness.gate.commit import CommandEnvelope, Gate
from harness.projections.mission import Mission
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.gate import (
    OPERATOR,
    TELL,
    complete,
    creation,
    dispatch,
    goal_verdict,
)
from tests.builders.missions_run import begin

KEY = InstallationKey(secret=bytes(32))
BASE = lease_stream(ResourceId("vbot-1/base"))
NAMES = tuple(MissionId(f"msn_{number}") for number in range(4))
LIFE: Sequence[Callable[[Mission], MissionCommand]] = (
    lambda mission: ActivateMission(),
    dispatch,
    complete,
    lambda mission: dispatch(mission, TELL),
    complete,
    lambda mission: JudgeGoal(verdict=goal_verdict(mission)),
)
"""What takes a mission from its contract to its success."""


def gate_on(store: EventStore, folds: AggregateCache | None = None, snapshots: Snapshots | None = None) -> Gate:
    clock = LockstepClock(lambda until_s: until_s, at_s=1000.0, wall=lambda: 2000.0)
    return Gate(store=store, clock=clock, deciders=DECIDERS, folds=folds, snapshots=snapshots)


def lived(gate: Gate, order: Sequence[int]) -> None:
    """Each number lets that mission do its next step, together with a lease that is taken or given back."""
    done = dict.fromkeys(NAMES, 0)
    for number in order:
        name = NAMES[number]
        at = done[name]
        if at > len(LIFE):
            continue
        stream = mission_stream(name)
        command = LIFE[at - 1](gate.state(stream)) if at else creation(name)
        leases = [CommandEnvelope(BASE, one, None) for one in (lease_of(gate, name),) if at]
        decision = gate.commit([CommandEnvelope(stream, command, None), *leases])
        assert isinstance(decision, Accepted), decision
        done[name] += 1


def lease_of(gate: Gate, name: MissionId) -> AcquireLease | ReleaseLease:
    held = gate.state(BASE)
    if held.status == "held":
        return ReleaseLease(invocation_id=held.invocation_id, reason="done")
    return AcquireLease(
        resource=ResourceId("vbot-1/base"),
        mission_id=name,
        invocation_id=InvocationId(f"inv_{held.version}"),
        token=held.token + 1,
        expires_s=2000.0,
    )


@pytest.mark.ledger("R143", symbol="harness.gate.commit:Gate._folded")
@given(order=st.lists(st.integers(0, len(NAMES) - 1), max_size=30))
def test_whatever_is_given_up_in_between_the_same_is_decided_written_and_known(order: list[int]) -> None:
    kept_all, kept_none = MemoryEventStore(), MemoryEventStore()
    rich, poor = gate_on(kept_all), gate_on(kept_none, AggregateCache(missions=0, others=0))
    lived(rich, order)
    lived(poor, order)
    assert kept_none.read(0, 10_000) == kept_all.read(0, 10_000)
    for stream in kept_all.streams(""):
        assert encode(poor.state(stream)) == encode(rich.state(stream))


@pytest.mark.ledger("R143", symbol="harness.gate.commit:Gate._folded")
def test_a_mission_that_was_given_up_comes_back_from_its_snapshot_and_tail_as_it_was(tmp_path: Path) -> None:
    with (
        closing(open_log(f"sqlite:///{tmp_path}/log")) as log,
        simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, store=log) as harness,
    ):
        mission = harness.supervisor.run(begin(harness, "warehouse-inspection"))
        stream = mission_stream(mission.mission_id)
        with closing(StoredSnapshots(log, KEY, every=32)) as keeper:
            assert encode(gate_on(log, snapshots=keeper).state(stream)) == encode(mission)
        assert log.snapshot(stream) is not None
        gate = gate_on(log, AggregateCache(missions=1), StoredSnapshots(log, KEY, keeping=False))
        for _ in range(2):
            assert encode(gate.state(stream)) == encode(mission)
            gate.state(mission_stream(MissionId("msn_other")))


class Watched(MemoryEventStore):
    """Counts the events that were read, what was restored and what was offered to be kept."""

    def __init__(self) -> None:
        super().__init__()
        self.read_events = 0
        self.restored: list[StreamId] = []
        self.offered: list[tuple[StreamId, int]] = []

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        tail = super().load(stream, after)
        self.read_events += len(tail)
        return tail

    def restore(self, stream: StreamId, initial: State) -> tuple[State, int]:
        self.restored.append(stream)
        return initial, 0

    def offer(self, stream: StreamId, version: int, state: object) -> None:
        self.offered.append((stream, version))


@pytest.mark.ledger("R143", symbol="harness.gate.commit:Gate._folded")
@pytest.mark.ledger("R143", symbol="harness.gate.commit:Gate._append")
def test_what_is_kept_is_neither_read_nor_restored_nor_offered_again() -> None:
    store = Watched()
    gate = gate_on(store, snapshots=store)
    lived(gate, [0] * (len(LIFE) + 1))
    stream = mission_stream(NAMES[0])
    assert gate.state(stream).status == "succeeded"
    assert store.read_events == 0 < store.head().position
    assert sorted(store.restored) == sorted({stream, BASE})
    assert len(store.offered) == len(set(store.offered))
    afresh = gate_on(store, snapshots=store)
    versions = [len(store.load(stream))]
    store.read_events, store.offered = 0, []
    assert encode(afresh.state(stream)) == encode(afresh.state(stream)) == encode(gate.state(stream))
    assert ([store.read_events], [version for _, version in store.offered]) == (versions, versions)


def test_threads_that_take_each_others_folds_away_lose_no_commit() -> None:
    store = MemoryEventStore()
    gate, together = gate_on(store, AggregateCache(missions=1, others=0)), Barrier(len(NAMES))

    def vetoed(name: MissionId) -> None:
        together.wait()
        for number in range(50):
            veto = RaiseVeto(layer=f"{name}-{number}", reason="test")
            assert isinstance(
                gate.commit([CommandEnvelope(mission_stream(one), veto, None) for one in NAMES[:2]]), Accepted
            )
            gate.state(mission_stream(NAMES[number % len(NAMES)]))

    for name in NAMES:
        assert isinstance(gate.commit([CommandEnvelope(mission_stream(name), creation(name), None)]), Accepted)
    with ThreadPoolExecutor(len(NAMES)) as threads:
        list(threads.map(vetoed, NAMES))
    for name in NAMES[:2]:
        known = gate.state(mission_stream(name))
        assert len(known.vetoes) == 50 * len(NAMES)
        assert encode(known) == encode(gate_on(store).state(mission_stream(name)))
    assert store.verify() == store.head()


def test_a_house_that_ran_many_missions_keeps_a_bounded_number_of_folds() -> None:
    store = MemoryEventStore()
    folds = AggregateCache()
    gate = gate_on(store, folds)
    for number in range(2 * KEPT_MISSIONS):
        stream = mission_stream(MissionId(f"msn_{number}"))
        assert isinstance(gate.commit([CommandEnvelope(stream, creation(MissionId(f"msn_{number}")), None)]), Accepted)
        assert isinstance(
            gate.commit([CommandEnvelope(stream, StopMission(actor=OPERATOR, reason="enough"), None)]), Accepted
        )
    assert len(folds) == KEPT_MISSIONS


def test_what_was_asked_for_longest_ago_is_given_up_first() -> None:
    kept = AggregateCache(others=2)
    a, b, c = (lease_stream(ResourceId(f"vbot-1/{name}")) for name in "abc")
    kept.put(a, "state", 1)
    kept.put(b, "state", 2)
    assert kept.get(a) == ("state", 1)
    kept.put(c, "state", 3)
    assert [kept.get(stream) for stream in (a, b, c)] == [("state", 1), None, ("state", 3)]
    kept.put(c, "newer", 4)
    assert len(kept) == 2 and kept.get(c) == ("newer", 4)


def test_small_streams_drive_no_mission_out() -> None:
    kept = AggregateCache(missions=1, others=1)
    kept.put(mission_stream(NAMES[0]), "mission", 7)
    for number in range(5):
        kept.put(lease_stream(ResourceId(f"vbot-1/{number}")), "lease", 1)
    assert kept.get(mission_stream(NAMES[0])) == ("mission", 7)


class Believed(MemoryEventStore):
    """Restores every mission as another one, as if that snapshot had been sealed."""

    def __init__(self, other: Gate) -> None:
        super().__init__()
        self._other = other

    def restore(self, stream: StreamId, initial: State) -> tuple[State, int]:
        version = len(self.load(stream))
        if stream.startswith("mission/") and version:
            return replace(self._other.state(stream), version=version), version
        return initial, 0

    def offer(self, stream: StreamId, version: int, state: object) -> None:
        """Nothing is kept."""


def test_a_goal_is_decided_on_its_events_even_where_a_snapshot_says_that_all_was_committed() -> None:
    whole = MemoryEventStore()
    lived(gate_on(whole), [0] * len(LIFE))  # everything but the goal
    stream, judge = mission_stream(NAMES[0]), LIFE[-1]
    store = Believed(gate_on(whole))
    lived(gate_on(store), [0, 0])  # created and compiled: nothing was done
    gate = gate_on(store, snapshots=store)
    believed = gate.state(stream)
    assert all(node.status == "committed" for node in believed.nodes.values())
    decision = gate.commit([CommandEnvelope(stream, judge(believed), None)])
    assert isinstance(decision, Refused), decision
    assert gate.state(stream).status != "succeeded"
