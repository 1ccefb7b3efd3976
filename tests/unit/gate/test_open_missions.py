"""Open missions are followed along the log, and ended ones are not read again."""

import pytest

from harness.adapters.stores.memory import MemoryEventStore
from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.commands import StopMission
from harness.contracts.ids import RobotId, StreamId, mission_stream
from harness.contracts.ports import StoredEvent
from harness.gate.open_missions import OpenMissions
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import begin
from tests.unit.stores.builders import NOW, batch

ADA = Actor(name="ada", role="operator")


class CountedStore(MemoryEventStore):
    """Counts which streams are loaded, and how often the whole log is asked."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded: list[StreamId] = []
        self.surveys = 0

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        self.loaded.append(stream)
        return super().load(stream, after)

    def open_missions(self) -> list[StreamId]:
        self.surveys += 1
        return super().open_missions()


def test_missions_come_and_go_as_the_log_says_and_the_whole_log_is_asked_once() -> None:
    store = CountedStore()
    store.append([batch("mission/a", 0, "MissionCreated")], [], NOW)
    followed = OpenMissions(store)
    assert list(followed.streams()) == ["mission/a"]
    store.append([batch("mission/b", 0, "MissionCreated", "MissionActivated"), batch("lease/x", 0, "Taken")], [], NOW)
    assert list(followed.streams()) == ["mission/a", "mission/b"]
    store.append([batch("mission/a", 1, "MissionEnded")], [], NOW)
    store.append([batch("mission/a", 2, "CompletionDisputed")], [], NOW)
    assert list(followed.streams()) == ["mission/b"]
    store.append([batch("mission/c", 0, "MissionCreated", "MissionEnded")], [], NOW)
    assert list(followed.streams()) == ["mission/b"]
    assert store.surveys == 1


@pytest.mark.parametrize("missions", [999, 1000, 1001, 2500])
def test_however_much_was_appended_meanwhile_nothing_is_missed(missions: int) -> None:
    store = MemoryEventStore()
    followed = OpenMissions(store)
    assert list(followed.streams()) == []
    store.append([batch(f"mission/{number}", 0, "MissionCreated") for number in range(missions)], [], NOW)
    assert len(followed.streams()) == missions


def test_one_step_of_the_loop_loads_no_mission_that_is_over() -> None:
    store = CountedStore()
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=1, store=store) as harness:
        for seed in range(3):
            mission_id = begin(harness, "circuit", seed=seed)
            harness.runtime.submit(mission_id, StopMission(actor=ADA, reason="enough"))
            assert harness.supervisor.run(mission_id).ended
        last = begin(harness, "circuit")
        store.loaded.clear()
        harness.supervisor.close_interrupted_replays()
        assert [one.mission_id for one in harness.supervisor.unfinished(RobotId("vbot-1"))] == [last]
    assert {stream for stream in store.loaded if stream.startswith("mission/")} == {mission_stream(last)}
