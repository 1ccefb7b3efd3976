"""Missions that ended under one configuration are followed along the log: each is folded for it once."""

from collections.abc import Callable

from harness.adapters.stores.memory import MemoryEventStore
from harness.contracts.ids import Digest, StreamId
from harness.gate.ended_missions import KEPT_QUESTIONS, EndedMissions
from harness.projections.mission import Mission
from tests.unit.stores.builders import NOW, batch

OLD, NEW = Digest("0" * 64), Digest("1" * 64)


class Looked:
    """Folds a mission to its configuration, NEW where its name says so, and remembers for whom it was asked."""

    def __init__(self) -> None:
        self.at: list[StreamId] = []

    def __call__(self, stream: StreamId) -> Mission:
        self.at.append(stream)
        return Mission(configuration=NEW if "new" in stream else OLD)


def ended(store: MemoryEventStore, *names: str) -> int:
    """These missions are created and end; the log's last position."""
    store.append([batch(f"mission/{name}", 0, "MissionCreated") for name in names], [], NOW)
    return store.append([batch(f"mission/{name}", 1, "MissionEnded") for name in names], [], NOW).position


def followed() -> tuple[MemoryEventStore, Looked, Callable[[int], list[str]]]:
    store, looked = MemoryEventStore(), Looked()
    missions = EndedMissions(store, looked)
    return store, looked, lambda after: list(missions.under(NEW, after=after))


def test_only_what_ended_behind_the_position_under_the_version_is_found_in_the_order_of_its_end() -> None:
    store, _, under = followed()
    began = ended(store, "new-before", "old-before")
    store.append([batch("mission/new-later", 0, "MissionCreated")], [], NOW)
    assert under(began) == []
    ended(store, "old-1", "new-1")
    store.append([batch("mission/new-later", 1, "MissionEnded")], [], NOW)
    assert under(began) == ["mission/new-1", "mission/new-later"]
    assert under(0) == ["mission/new-before", "mission/new-1", "mission/new-later"]


def test_each_mission_is_looked_at_once_however_often_is_asked() -> None:
    store, looked, under = followed()
    began = ended(store, *(f"old-before-{number}" for number in range(50)))
    for number in range(20):
        ended(store, f"old-{number}", f"new-{number}")
        assert len(under(began)) == len(under(began)) == number + 1
    assert len(looked.at) == len(set(looked.at)) == 40


def test_a_question_that_was_given_up_is_answered_alike_again() -> None:
    store, looked, under = followed()
    head = ended(store, *(f"new-{number}" for number in range(KEPT_QUESTIONS)))
    first = under(0)
    assert len(first) == KEPT_QUESTIONS < head
    for after in range(1, KEPT_QUESTIONS + 1):
        under(after)
    before = len(looked.at)
    assert under(0) == first
    assert len(looked.at) == before + KEPT_QUESTIONS
