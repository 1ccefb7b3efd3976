"""Appends of several threads share a commit; each still succeeds or fails for itself. What is not new is not read."""

import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from sqlalchemy import Connection

from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.errors import ConcurrencyConflict
from harness.contracts.ids import StreamId
from harness.contracts.ports import Batch, Head, Record, StoredEvent
from tests.unit.stores.builders import NOW, batch, record

THREADS = 8
PATIENCE_S = 10.0


class CountedStore(SqlEventStore):
    """The event log, counting its commits and how many appends wait for the next one."""

    commits = 0

    def _commit(self, writer: Connection, events: Sequence[StoredEvent], records: Sequence[Record]) -> None:
        self.commits += 1
        super()._commit(writer, events, records)

    @property
    def queued(self) -> int:
        return len(self._waiting)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[CountedStore]:
    with closing(CountedStore(f"sqlite:///{tmp_path / 'log.db'}")) as opened:
        yield opened


@contextmanager
def busy(tmp_path: Path) -> Iterator[None]:
    """Another process writes for as long as the block lasts."""
    with closing(sqlite3.connect(tmp_path / "log.db", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield
        other.execute("ROLLBACK")


def until(true: Callable[[], bool]) -> None:
    """Give the threads time to get there."""
    latest_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < latest_s, "the threads did not get there"
        time.sleep(0.001)


def appended_together(store: CountedStore, tmp_path: Path, batches: Sequence[Batch]) -> list[Future[Head]]:
    """Append the first, and while it waits for the disk all the others."""
    with ThreadPoolExecutor(len(batches)) as threads:
        with busy(tmp_path):
            first = threads.submit(store.append, [batches[0]], [record("note", "first")], NOW)
            until(lambda: store.queued == 0 and first.running())
            others = [
                threads.submit(store.append, [one], [record("note", number)], NOW)
                for number, one in enumerate(batches[1:])
            ]
            until(lambda: store.queued == len(others))
        return [first, *others]


def test_appends_that_come_during_a_commit_share_the_next_one(store: CountedStore, tmp_path: Path) -> None:
    batches = [batch(f"mission/{number}", 0, "Seen") for number in range(THREADS)]
    heads = [future.result() for future in appended_together(store, tmp_path, batches)]
    assert store.commits == 2
    assert sorted(head.position for head in heads) == list(range(1, THREADS + 1))
    assert store.verify() == max(heads, key=lambda head: head.position)
    assert all(store.record(record("note", number).digest) for number in range(THREADS - 1))


def test_an_append_that_does_not_fit_is_refused_alone(store: CountedStore, tmp_path: Path) -> None:
    batches = [
        batch("mission/0", 0, "Seen"),
        batch("mission/1", 0, "Seen"),
        batch("mission/1", 0, "Seen"),
        batch("mission/2", 0, "Seen"),
    ]
    futures = appended_together(store, tmp_path, batches)
    refused = [future for future in futures if isinstance(future.exception(), ConcurrencyConflict)]
    assert len(refused) == 1 and refused[0] in futures[1:3]
    assert [event.stream for event in store.read()] == ["mission/0", "mission/1", "mission/2"]
    assert len(store.streams("mission/")) == 3
    store.verify()


def test_a_refused_append_leaves_no_record_behind(store: CountedStore) -> None:
    store.append([batch("mission/0", 0, "Seen")], [], NOW)
    with pytest.raises(ConcurrencyConflict):
        store.append([batch("mission/0", 0, "Seen")], [record("note", "never")], NOW)
    assert store.head().position == 1
    with closing(sqlite3.connect(store.where)) as raw:
        assert raw.execute("SELECT count(*) FROM record").fetchone() == (0,)


def test_what_another_process_appended_is_loaded_although_our_own_is_known(store: CountedStore, tmp_path: Path) -> None:
    ours = StreamId("mission/0")
    store.append([batch(ours, 0, "Seen")], [], NOW)
    assert store.load(ours, 1) == []
    with closing(SqlEventStore(f"sqlite:///{tmp_path / 'log.db'}")) as other:
        head = other.append([batch(ours, 1, "Seen")], [], NOW)
    assert [event.version for event in store.load(ours, 1)] == [2]
    assert store.head() == head
