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
from harness.contracts.ports import Batch, LogHead, Record, StoredEvent
from tests.unit.stores.builders import NOW, batch, record

THREADS = 8
PATIENCE_S = 60.0


class CountedStore(SqlEventStore):
    """The event log, counting its commits and how many appends wait for the next one."""

    commits = 0

    def _commit(self, writer: Connection, events: Sequence[StoredEvent], records: Sequence[Record]) -> None:
        self.commits += 1
        super()._commit(writer, events, records)

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def writes(self) -> bool:
        """Whether an append has taken everything that waited, itself included, and is on its way to the disk."""
        return self._lock.locked() and not self._waiting


@pytest.fixture
def store(tmp_path: Path) -> Iterator[CountedStore]:
    with closing(CountedStore(f"sqlite:///{tmp_path / 'log.db'}", busy_s=PATIENCE_S)) as opened:
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


def appended_together(store: CountedStore, tmp_path: Path, batches: Sequence[Batch]) -> list[Future[LogHead]]:
    """Append the first, and while it waits for the disk all the others."""
    with ThreadPoolExecutor(len(batches)) as threads:
        with busy(tmp_path):
            first = threads.submit(store.append, [batches[0]], [record("note", "first")], NOW)
            until(lambda: store.writes)
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


def test_a_stream_known_to_be_empty_is_read_again_once_another_process_wrote(
    store: CountedStore, tmp_path: Path
) -> None:
    theirs = StreamId("control/house")
    assert store.load(theirs) == [] == store.load(theirs)
    with closing(SqlEventStore(f"sqlite:///{tmp_path / 'log.db'}")) as other:
        other.append([batch(theirs, 0, "Seen")], [], NOW)
        assert [event.version for event in store.load(theirs)] == [1]
        assert store.load(theirs, 1) == []
        other.append([batch(theirs, 1, "Seen")], [], NOW)
        assert [event.version for event in store.load(theirs, 1)] == [2]


def test_what_another_process_wrote_between_two_of_our_commits_is_not_lost(store: CountedStore, tmp_path: Path) -> None:
    with closing(SqlEventStore(f"sqlite:///{tmp_path / 'log.db'}")) as other:
        for version in range(0, 10, 2):
            store.append([batch("mission/ours", version // 2, "Seen")], [], NOW)
            assert store.load(StreamId("mission/shared"), version) == []
            other.append([batch("mission/shared", version, "Seen", "Seen")], [], NOW)
            store.append([batch("mission/last", version // 2, "Seen")], [], NOW)
            tail = store.load(StreamId("mission/shared"), version)
            assert [event.version for event in tail] == [version + 1, version + 2]
            assert store.head() == other.head()


def test_a_log_that_was_filled_from_another_is_read_although_its_streams_were_empty(
    store: CountedStore, tmp_path: Path
) -> None:
    stream = StreamId("mission/0")
    assert store.load(stream) == []
    with closing(SqlEventStore(f"sqlite:///{tmp_path / 'other.db'}")) as other:
        other.append([batch(stream, 0, "Seen")], [], NOW)
        head = store.fill_from(other)
    assert [event.version for event in store.load(stream)] == [1]
    assert store.head() == head


def test_what_was_read_before_a_commit_is_not_taken_for_the_end_of_the_stream(store: CountedStore) -> None:
    stream = StreamId("mission/0")
    assert store.load(stream) == []
    ticket = store._unchanged.ticket()
    store.append([batch(stream, 0, "Seen")], [], NOW)
    store._unchanged.found(stream, 0, ticket=ticket)
    assert [event.version for event in store.load(stream)] == [1]


def test_a_question_does_not_wait_for_a_commit_on_its_way_to_the_disk(store: CountedStore, tmp_path: Path) -> None:
    stream = StreamId("mission/0")
    store.append([batch(stream, 0, "Seen")], [], NOW)
    assert store.load(stream, 1) == []
    with ThreadPoolExecutor(1) as pool, busy(tmp_path):
        waiting = pool.submit(store.append, [batch("mission/1", 0, "Seen")], [], NOW)
        until(lambda: store.writes)
        assert store.load(stream, 1) == []
        assert not waiting.done()
    assert waiting.result().position == 2
