"""What a worker knows of the log on a server between its questions: never more than is stored, and soon all of it."""

import random
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from threading import Barrier, Thread

import pytest
from sqlalchemy.event import listen

from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.version_cache import HELD_EVENTS
from harness.contracts.errors import ConcurrencyConflict
from harness.contracts.ids import StreamId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import Batch, NewEvent
from harness.followers import Follower, beginning
from tests.unit.stores.builders import NOW
from tests.unit.test_followers import Positions
from tools.postgres import PostgresServer

pytestmark = pytest.mark.xdist_group("postgres")

SHARED = StreamId("lease/shared")
ROUNDS = 40


def stream(number: int) -> StreamId:
    return StreamId(f"lease/{number}")


def added(store: PostgresEventStore, name: StreamId, count: int = 1) -> None:
    """Appended behind what the store knows of the stream; decided again where somebody else was first."""
    while True:
        version = len(store.load(name))
        events = tuple(NewEvent(kind="Tested", body=b"{}") for _ in range(count))
        try:
            store.append([Batch(stream=name, expected_version=version, events=events)], (), NOW)
        except ConcurrencyConflict:
            continue
        return


@pytest.fixture
def opened(postgres: PostgresServer) -> Iterator[Callable[[], PostgresEventStore]]:
    """Opens one more worker's store on the same log."""
    url = postgres.database()
    with ExitStack() as stack:
        yield lambda: stack.enter_context(closing(PostgresEventStore(url)))


def test_a_turn_asks_the_server_once_for_all_streams_whoever_wrote(opened: Callable[[], PostgresEventStore]) -> None:
    one, other = opened(), opened()
    for number in range(5):
        added(one, stream(number))
    questions: list[object] = []
    listen(one._readers, "checkout", lambda *lent: questions.append(lent))
    with one.turn():
        assert [one.load(stream(number), 1) for number in range(5)] == [[]] * 5
        assert one.head().position == 5
    assert len(questions) == 1
    added(other, stream(3))
    questions.clear()
    with one.turn():
        assert [len(one.load(stream(number), 1)) for number in range(5)] == [0, 0, 0, 1, 0]
        assert one.head() == other.head()
    assert len(questions) == 2  # the look, and the one stream that moved


@pytest.mark.parametrize("others", [1, HELD_EVENTS - 2, HELD_EVENTS, 3 * HELD_EVENTS])
def test_however_much_another_worker_wrote_the_next_turn_knows_it(
    opened: Callable[[], PostgresEventStore], others: int
) -> None:
    one, other = opened(), opened()
    added(one, SHARED)
    added(one, stream(1))
    added(other, SHARED, others)
    with one.turn():
        assert len(one.load(SHARED, 1)) == others
        assert one.load(stream(1), 1) == []
    added(one, SHARED)
    assert one.head() == other.head() == one.verify()


def test_whoever_did_not_look_since_another_worker_wrote_appends_nothing_on_what_it_knew(
    opened: Callable[[], PostgresEventStore],
) -> None:
    one, other = opened(), opened()
    added(one, SHARED)
    with one.turn():
        added(other, SHARED)
        late = Batch(stream=SHARED, expected_version=1, events=(NewEvent(kind="Tested", body=b"{}"),))
        with pytest.raises(ConcurrencyConflict):
            one.append([late], (), NOW)
        assert len(one.load(SHARED)) == 2
    assert one.verify().position == 2


@pytest.mark.parametrize("seed", range(3))
def test_a_follower_beside_another_worker_comes_to_the_end_of_the_log(
    opened: Callable[[], PostgresEventStore], seed: int
) -> None:
    one, other, reader = opened(), opened(), opened()
    chance, target = random.Random(seed), Positions(beginning("f"))
    follower = Follower(target, head=one.head, read=one.read, fold="f", batch=3)
    for _ in range(ROUNDS):
        added(one if chance.random() < 0.5 else other, SHARED)
        if chance.random() < 0.3:
            with one.turn():
                added(one, SHARED)
                follower.catch_up()
        head = reader.head()
        assert follower.catch_up() == FollowPosition(fold="f", position=head.position, digest=head.digest)
    assert [at for stretch in target.seen for at in stretch] == list(range(1, reader.head().position + 1))
    assert target.cleared == 0


def test_threads_of_one_worker_beside_another_worker_lose_no_event_and_count_right(
    opened: Callable[[], PostgresEventStore],
) -> None:
    one, other, together = opened(), opened(), Barrier(4, timeout=120)

    def work(store: PostgresEventStore, number: int) -> None:
        together.wait()
        for done in range(1, ROUNDS + 1):
            added(store, SHARED)
            with store.turn():
                added(store, stream(number))
                assert store.load(stream(number), done) == []
                assert len(store.load(stream(number))) == done

    threads = [Thread(target=work, args=(other if number == 3 else one, number)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert one.verify() == one.head() == other.head()
    for store in (one, other):
        assert [len(store.load(name)) for name in (SHARED, *map(stream, range(4)))] == [4 * ROUNDS, *[ROUNDS] * 4]
