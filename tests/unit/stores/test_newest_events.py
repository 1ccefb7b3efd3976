"""Events that this process appended are handed on to whoever follows the log, and never instead of another's."""

import random
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from harness.adapters.stores.sql import SqlEventStore
from harness.adapters.stores.version_cache import HELD_EVENTS
from harness.contracts.memory import FollowPosition
from harness.followers import Follower, beginning
from tests.unit.stores.builders import NOW, batch
from tests.unit.test_followers import Positions

Stores = tuple[SqlEventStore, SqlEventStore, SqlEventStore]


@pytest.fixture
def stores(tmp_path: Path) -> Iterator[Stores]:
    """Two processes' connections to one log, and one that only reads."""
    url = f"sqlite:///{tmp_path / 'events.db'}"
    with ExitStack() as stack:
        one, other, reader = (stack.enter_context(closing(SqlEventStore(url))) for _ in range(3))
        yield one, other, reader


def append(store: SqlEventStore, events: int = 1) -> None:
    version = len(store.load(batch("mission/a", 0).stream))
    store.append([batch("mission/a", version, *["Moved"] * events)], [], NOW)


@pytest.mark.parametrize("seed", range(4))
def test_reading_on_gives_what_the_log_holds_whoever_appended_it(stores: Stores, seed: int) -> None:
    one, other, reader = stores
    chance = random.Random(seed)
    for _ in range(60):
        if chance.random() < 0.7:
            append(one if chance.random() < 0.7 else other, chance.randint(1, 3))
        after, limit = chance.randint(0, reader.head().position + 1), chance.choice([1, 3, 1000])
        for store in (one, other):
            assert store.read(after, limit) == reader.read(after, limit)


def test_what_was_appended_longer_ago_than_is_held_is_read(stores: Stores) -> None:
    one, _, reader = stores
    append(one, HELD_EVENTS + 10)
    assert one.read(0) == reader.read(0)
    assert one.read(10) == reader.read(10)


def test_a_turn_reads_what_it_appends_and_what_another_process_appended_before_it(stores: Stores) -> None:
    one, other, _ = stores
    append(one)
    with one.turn():
        append(other)
        append(one)
        assert [event.position for event in one.read(0)] == [1, 2, 3]
    append(other)
    assert [event.position for event in one.read(2)] == [3, 4]


@pytest.mark.parametrize("seed", range(4))
def test_a_follower_beside_another_process_comes_to_the_end_of_the_log(stores: Stores, seed: int) -> None:
    one, other, reader = stores
    chance, target = random.Random(seed), Positions(beginning("f"))
    follower = Follower(target, head=one.head, read=one.read, fold="f", batch=3)
    for _ in range(40):
        append(one if chance.random() < 0.5 else other)
        if chance.random() < 0.3:
            with one.turn():
                append(one)
                follower.catch_up()
        head = reader.head()
        assert follower.catch_up() == FollowPosition(fold="f", position=head.position, digest=head.digest)
    assert [at for stretch in target.seen for at in stretch] == list(range(1, reader.head().position + 1))
    assert target.cleared == 0


def test_who_reads_further_than_a_turn_looked_is_told_one_end_of_the_log(stores: Stores) -> None:
    one, other, reader = stores
    append(other)
    append(one)
    with one.turn():
        append(other)
        assert one.read(2) == reader.read(2)
        assert one.read(0) == reader.read(0)
        assert one.head() == reader.head()
        target = Positions(beginning("f"))
        Follower(target, head=one.head, read=one.read, fold="f").catch_up()
    assert target.seen == [[1, 2, 3]]
    assert target.cleared == 0


def test_a_follower_whose_target_another_process_brought_further_than_a_turn_looked_rebuilds_nothing(
    stores: Stores,
) -> None:
    one, other, _ = stores
    append(one, 2)
    target = Positions(beginning("f"))
    with one.turn():
        append(other)
        Follower(target, head=other.head, read=other.read, fold="f").catch_up()
        Follower(target, head=one.head, read=one.read, fold="f").catch_up()
        assert one.head() == other.head()
    assert target.cleared == 0
