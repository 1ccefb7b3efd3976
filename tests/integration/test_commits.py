"""What is durable when: two commits per node on the happy path, the first before anything starts (D9)."""

from collections.abc import Sequence

import pytest

from harness.adapters.stores.memory import MemoryEventStore
from harness.bootstrap import simulated
from harness.contracts.ids import NodeId, mission_stream
from harness.contracts.ports import Batch, LogHead, Record
from harness.contracts.values import Moment
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import begin


def test_a_mission_whose_name_another_process_drew_is_created_under_the_next_one() -> None:
    store, settings = MemoryEventStore(), HarnessSettings(speed=0, fidelity="kinematic")
    with simulated(settings, simulator=SIMULATOR, seed=3, store=store) as one:
        first = begin(one, "circuit")
    with simulated(settings, simulator=SIMULATOR, seed=3, store=store) as other:
        second = begin(other, "circuit")
    created = [event.stream for event in store.read() if event.kind == "MissionCreated"]
    assert created == [mission_stream(first), mission_stream(second)] and first != second


class Counted(MemoryEventStore):
    """Remembers what each append carried."""

    def __init__(self) -> None:
        super().__init__()
        self.appends: list[tuple[str, ...]] = []

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> LogHead:
        self.appends.append(tuple(event.kind for batch in batches for event in batch.events))
        return super().append(batches, records, now)


@pytest.mark.ledger("R79", "R113", symbol="harness.supervisor.dispatch:Dispatcher._commit")
def test_a_node_takes_two_commits_and_its_intent_stands_before_its_start() -> None:
    store = Counted()
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, store=store) as harness:
        mission_id = begin(harness, "circuit")
        assert harness.supervisor.run(mission_id).status == "succeeded"
        (start,) = harness.starts(mission_id)
        intents = [event for event in store.load(mission_stream(mission_id)) if event.kind == "DispatchIntended"]
        intended = intents[-1]
        assert intended.mission_s <= start.at_s
        assert harness.runtime.mission(mission_id).of(NodeId("circuit")).attempt == 1
    of_nodes = [kinds for kinds in store.appends if {"DispatchIntended", "PacketRetained"} & set(kinds)]
    assert of_nodes == [
        ("NodePlanned", "DispatchIntended"),
        ("PacketRetained", "VerdictRecorded", "NodeCommitted"),
        ("NodePlanned", "DispatchIntended", "LeaseAcquired"),
        ("PacketRetained", "VerdictRecorded", "NodeCommitted", "LeaseReleased"),
    ]
