"""What the review desk reads of a long log: a canary its own missions, a release the newest; nothing of the rest."""

from collections.abc import Iterator

import pytest

from harness.adapters.stores.memory import MemoryEventStore
from harness.contracts.ids import MissionId, StreamId, mission_stream
from harness.contracts.ports import StoredEvent
from rsi_reviews.canary_metrics import LOOKED_AT, MOST_RECENT, recent_values
from tests.builders.releases import REVIEWER, ROBOT, Bench, bench, candidate, expect, say

MADE = candidate()
EARLIER = 6


class ReadStore(MemoryEventStore):
    """Remembers which streams were loaded."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded: set[StreamId] = set()

    def load(self, stream: StreamId, after: int = 0) -> list[StoredEvent]:
        self.loaded.add(stream)
        return super().load(stream, after)

    def missions(self) -> set[StreamId]:
        """Streams of missions that were loaded since this was last asked."""
        found = {stream for stream in self.loaded if stream.startswith("mission/")}
        self.loaded.clear()
        return found


@pytest.fixture
def store() -> ReadStore:
    return ReadStore()


@pytest.fixture
def on(store: ReadStore) -> Iterator[Bench]:
    """A desk whose robot has run several missions before anything was released."""
    with bench(store=store) as made:
        for _ in range(EARLIER):
            made.called_off(made.begun())
        yield made


def called_off(on: Bench, names: int) -> set[StreamId]:
    """Missions that a person stopped at once; their streams."""
    missions: list[MissionId] = [on.begun() for _ in range(names)]
    for mission in missions:
        on.called_off(mission)
    return {mission_stream(mission) for mission in missions}


@pytest.mark.ledger("R159", symbol="rsi_reviews.canary_metrics:canary_missions")
def test_a_canary_looks_at_no_mission_that_ended_before_it_began(on: Bench, store: ReadStore) -> None:
    name = on.in_canary(MADE)
    mission = on.begun()
    on.harness.supervisor.step(mission)
    store.missions()
    on.harness.supervisor.run(mission)
    expect(on.releases.catch_up())
    entry = on.releases.review(name).entry(mission)
    assert entry is not None and entry.finding is None
    assert on.releases.current(ROBOT) == MADE.baseline
    expect(on.releases.adjudicate(name, mission, "sound", say(REVIEWER)))
    assert on.releases.current(ROBOT) == MADE.configuration.configuration_id
    assert store.missions() == {mission_stream(mission)}


@pytest.mark.ledger("R159", symbol="rsi_reviews.candidate_queries:_occupied")
@pytest.mark.ledger("R159", symbol="rsi_reviews.canary_metrics:canary_missions")
def test_a_canary_mission_that_is_over_and_not_taken_in_yet_keeps_the_next_one_back(on: Bench) -> None:
    name = on.in_canary(MADE)
    mission = on.begun()
    assert on.releases.current(ROBOT) == MADE.configuration.configuration_id
    while not on.harness.runtime.mission(mission).invocation:
        on.harness.clock.wait_until(on.harness.supervisor.step(mission) or 0.0)
    assert on.releases.current(ROBOT) == MADE.baseline
    on.harness.supervisor.run(mission)
    assert on.harness.runtime.mission(mission).ended
    expect(on.releases.comment(name, say(REVIEWER, "I watched it.")))
    assert on.releases.current(ROBOT) == MADE.baseline
    expect(on.releases.catch_up())
    assert on.releases.review(name).entry(mission) is not None
    assert on.releases.current(ROBOT) == MADE.baseline
    expect(on.releases.adjudicate(name, mission, "sound", say(REVIEWER)))
    assert on.releases.current(ROBOT) == MADE.configuration.configuration_id


def test_the_newest_missions_are_read_one_by_one_and_no_further_than_asked(on: Bench, store: ReadStore) -> None:
    newest = called_off(on, 2)
    store.missions()
    missions = on.harness.runtime.newest_missions()
    assert {mission_stream(next(missions).mission_id) for _ in newest} == newest == store.missions()
    values = recent_values(on.harness.runtime, "handoffs", MADE.baseline, ROBOT)
    assert len(values) == EARLIER + len(newest) < MOST_RECENT < LOOKED_AT
    assert recent_values(on.harness.runtime, "handoffs", MADE.configuration.configuration_id, ROBOT) == ()
