"""The log is away for a moment, before or after it took an append: whoever steps a mission asks again; it goes on."""

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import pytest
from msgspec.structs import replace

from harness.adapters.stores.memory import MemoryEventStore
from harness.baseline.load import site
from harness.bootstrap import Harness, simulated
from harness.contracts.commands import StopMission
from harness.contracts.errors import StoreUnavailable
from harness.contracts.handoff_events import NoAnswerTaken
from harness.contracts.ids import MissionId, StreamId
from harness.contracts.ports import Batch, LogHead, Record, StoredEvent
from harness.contracts.values import Moment
from harness.projections.mission import Mission
from harness.settings import HarnessSettings
from harness.supervisor.agent_loop import AgentLoop
from harness.supervisor.supervisor import OUTAGE_TRIES, OUTAGE_WAIT_S
from simulator.in_process import SIMULATOR
from simulator.robot import SimulatedRobot
from tests.builders.missions_run import OPERATOR, ROBOT, begin
from tests.builders.waiting import Waiting, waiting


class AwayStore(MemoryEventStore):
    """Nobody answers for so many calls once an append that `strikes` names comes: before it is stored, or after."""

    def __init__(self) -> None:
        super().__init__()
        self.strikes: Callable[[Sequence[str]], bool] = lambda kinds: False
        self.after = False
        self.lasts = 3
        self.calls = self.outages = 0

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> LogHead:
        self._answer()
        struck = self.strikes([event.kind for batch in batches for event in batch.events])
        if struck:
            self.strikes = lambda kinds: False
            self.calls, self.outages = self.lasts, self.outages + 1
        if struck and not self.after:
            self._answer()
        head = super().append(batches, records, now)
        if struck:
            self._answer()
        return head

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        self._answer()
        return super().load(stream, after)

    def _answer(self) -> None:
        if self.calls:
            self.calls -= 1
            raise StoreUnavailable("The log is away", where="test", do="wait")


def nth(number: int) -> Callable[[Sequence[str]], bool]:
    """Strikes at the append of this number, from 1."""
    seen = iter(range(1, 10_000))
    return lambda kinds: next(seen) == number


@contextmanager
def away_stand() -> Iterator[tuple[AwayStore, Harness, MissionId]]:
    store = AwayStore()
    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, store=store) as harness:
        yield store, harness, begin(harness, "circuit")


def stepped(harness: Harness, mission_id: MissionId) -> Mission:
    """As any caller of `step` may: after an outage it asks again half a second later."""
    for _ in range(2000):
        wake_s: float | None = harness.clock.now().mission_s + 0.5
        with suppress(StoreUnavailable):
            wake_s = harness.supervisor.step(mission_id)
        if wake_s is None:
            break
        harness.clock.wait_until(wake_s)
    return harness.runtime.mission(mission_id)


def assert_sound(store: AwayStore, harness: Harness, mission: Mission) -> None:
    """It struck, the mission succeeded none the less, nothing was started twice, and nothing is missing in the log."""
    starts = harness.starts(mission.mission_id)
    assert store.outages == 1
    assert mission.status == "succeeded", mission.reason
    assert len({start.request_id for start in starts}) == len(starts) == 1
    assert mission.spent_total == 0
    assert store.verify() == store.head()


APPENDS = 6
"""So many commits a circuit makes after it was created."""


def test_a_circuit_makes_so_many_commits() -> None:
    with away_stand() as (store, harness, mission_id):
        kinds: list[Sequence[str]] = []
        store.strikes = lambda one: bool(kinds.append(one))
        assert harness.supervisor.run(mission_id).status == "succeeded"
        assert len(kinds) == APPENDS


@pytest.mark.parametrize("after", [False, True], ids=["not stored", "stored"])
@pytest.mark.parametrize("number", range(1, APPENDS + 1))
def test_a_caller_of_step_that_asks_again_gets_the_mission_to_its_end(number: int, after: bool) -> None:
    with away_stand() as (store, harness, mission_id):
        store.strikes, store.after = nth(number), after
        assert_sound(store, harness, stepped(harness, mission_id))


@pytest.mark.parametrize("after", [False, True], ids=["not stored", "stored"])
@pytest.mark.parametrize("number", range(1, APPENDS + 1))
def test_a_run_in_the_foreground_outlives_a_log_that_is_away_for_a_moment(number: int, after: bool) -> None:
    with away_stand() as (store, harness, mission_id):
        store.strikes, store.after = nth(number), after
        assert_sound(store, harness, harness.supervisor.run(mission_id))


def test_a_log_that_stays_away_ends_the_run_and_the_mission_goes_on_when_it_is_back() -> None:
    with away_stand() as (store, harness, mission_id):
        store.strikes, store.lasts = nth(4), 100 * OUTAGE_TRIES
        before_s = harness.clock.now().mission_s
        with pytest.raises(StoreUnavailable):
            harness.supervisor.run(mission_id)
        assert harness.clock.now().mission_s > before_s + OUTAGE_TRIES * OUTAGE_WAIT_S
        store.calls = 0
        assert_sound(store, harness, harness.supervisor.run(mission_id))


@pytest.mark.parametrize("after", [False, True], ids=["not stored", "stored"])
def test_what_a_loop_took_for_stored_when_the_log_went_away_is_said_again(after: bool) -> None:
    with away_stand() as (store, harness, mission_id):
        robot = harness.robots[ROBOT]
        assert isinstance(robot, SimulatedRobot)
        while harness.runtime.mission(mission_id).invocation is None:
            harness.clock.wait_until(harness.supervisor.step(mission_id) or 0.0)
        store.strikes, store.after = (lambda kinds: "EpochChanged" in kinds), after
        robot.world.site = replace(robot.world.site, map_version="site-2")
        with suppress(StoreUnavailable):
            while not store.outages:
                harness.clock.wait_until(harness.supervisor.step(mission_id) or 0.0)
        store.calls = 0
        harness.supervisor.step(mission_id)
        kinds = [event.kind for event in harness.runtime.events(mission_id)]
        assert "EpochChanged" in kinds


@contextmanager
def unanswered(store: AwayStore) -> Iterator[Waiting]:
    zones = tuple(replace(zone, no_answer="lie_down") for zone in site().zones)
    with waiting(site=replace(site(), zones=zones), store=store) as made:
        yield made.asked()


@pytest.mark.parametrize("kind", ["HandoffExpired", "NoAnswerTaken@2"])
@pytest.mark.parametrize("after", [False, True], ids=["not stored", "stored"])
def test_what_is_done_without_an_answer_is_done_and_told_once_though_the_log_was_away(kind: str, after: bool) -> None:
    store = AwayStore()
    with unanswered(store) as asked:
        store.strikes, store.after = (lambda kinds: kind in kinds), after
        with pytest.raises(StoreUnavailable):
            asked.pass_s(901.0)
        store.calls = 0
        asked.pass_s(1.0)
        assert (asked.handoff.status, asked.mission.status) == ("expired", "safe_stopped")
        assert asked.robot.status().posture == "lying"
        assert [one.done for one in asked.told if isinstance(one, NoAnswerTaken)] == [True]


def test_the_loops_of_missions_that_are_over_do_not_stay_in_memory() -> None:
    def loops() -> int:
        gc.collect()
        return sum(isinstance(one, AgentLoop) for one in gc.get_objects())

    with simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3) as harness:
        before = loops()
        for seed in range(3):
            mission_id = begin(harness, "circuit", seed=seed)
            harness.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
            assert harness.supervisor.run(mission_id).ended
        assert loops() <= before + 1
