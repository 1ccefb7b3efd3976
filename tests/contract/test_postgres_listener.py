"""Appends of other processes are told as stream names, also those that happened while nobody could tell."""

from collections.abc import Iterator
from contextlib import closing
from queue import Empty, SimpleQueue

import pytest

from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.postgres_listener import Listener
from harness.contracts.errors import StoreUnavailable
from tests.saying import raises_saying
from tests.unit.stores.builders import NOW, batch
from tests.unit.stores.processes import lines, running
from tools.postgres import PostgresServer

pytestmark = pytest.mark.xdist_group("postgres")


@pytest.fixture
def log(postgres: PostgresServer) -> Iterator[tuple[str, PostgresEventStore]]:
    url = postgres.database()
    with closing(PostgresEventStore(url)) as store:
        yield url, store


def told(names: "SimpleQueue[str]", *expected: str) -> bool:
    """Whether exactly these names come, in this order."""
    try:
        return tuple(names.get(timeout=60) for _ in expected) == expected and names.empty()
    except Empty:
        return False


def test_an_append_is_told_once_per_stream_and_only_after_it_is_committed(log: tuple[str, PostgresEventStore]) -> None:
    url, store = log
    store.append([batch("mission/old", 0, "Asked")], [], NOW)
    names: SimpleQueue[str] = SimpleQueue()
    with closing(Listener(url, names.put)):
        store.append([batch("mission/a", 0, "Asked", "Compiled"), batch("lease/base", 0, "Taken")], [], NOW)
        assert told(names, "mission/a", "lease/base")
        assert store.load(batch("lease/base", 0).stream)


def test_appends_of_another_process_are_told(log: tuple[str, PostgresEventStore]) -> None:
    url, _ = log
    names: SimpleQueue[str] = SimpleQueue()
    with closing(Listener(url, names.put)), running("race", url, "mission/b", "1") as child:
        assert lines(child, 1) == ["1"]
        assert told(names, "mission/b")


def test_what_was_appended_while_the_listener_was_cut_off_is_told_afterwards(
    postgres: PostgresServer, log: tuple[str, PostgresEventStore]
) -> None:
    url, store = log
    store.append([batch("mission/old", 0, "Asked")], [], NOW)
    names: SimpleQueue[str] = SimpleQueue()
    with closing(Listener(url, names.put)):
        postgres.execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query LIKE 'SELECT coalesce(max(position)%'"
        )
        store.append([batch("mission/a", 0, "Asked")], [], NOW)
        assert told(names, "mission/a")
        store.append([batch("mission/a", 1, "Compiled")], [], NOW)
        assert told(names, "mission/a")


def test_a_listener_lives_through_a_restart_of_the_server(
    postgres: PostgresServer, log: tuple[str, PostgresEventStore]
) -> None:
    url, store = log
    names: SimpleQueue[str] = SimpleQueue()
    with closing(Listener(url, names.put)):
        postgres.stop("immediate")
        postgres.start()
        store.append([batch("mission/a", 0, "Asked")], [], NOW)
        assert told(names, "mission/a")


def test_a_closed_listener_tells_nothing_and_one_that_cannot_begin_says_why(
    log: tuple[str, PostgresEventStore],
) -> None:
    url, store = log
    names: SimpleQueue[str] = SimpleQueue()
    listener = Listener(url, names.put)
    listener.close()
    listener.close()
    store.append([batch("mission/a", 0, "Asked")], [], NOW)
    assert names.empty()
    with raises_saying(StoreUnavailable, match="nowhere"):
        Listener(url.replace("@/", "@/nowhere_"), names.put)
