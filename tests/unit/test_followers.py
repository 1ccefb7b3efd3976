"""The one catch-up loop: to the head, anew where the log is another, again where somebody else was faster."""

from collections.abc import Sequence

import pytest

from harness.adapters.stores.memory import MemoryEventStore
from harness.contracts.errors import ConcurrencyConflict, StoreUnavailable
from harness.contracts.ids import Digest, StreamId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import Batch, NewEvent, StoredEvent
from harness.contracts.values import Moment
from harness.followers import Follower, beginning

NOW = Moment(mission_s=1.0, wall_s=2.0)
STREAM = StreamId("mission/a")


class Positions:
    """What is made of the log here: the positions seen, in stretches."""

    def __init__(self, mark: FollowPosition) -> None:
        self.stands, self.seen, self.cleared = mark, list[list[int]](), 0

    def mark(self) -> FollowPosition:
        return self.stands

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        assert after == self.stands
        self.seen.append([one.position for one in fresh])
        self.stands = upto

    def clear(self) -> None:
        self.stands, self.seen, self.cleared = beginning("f"), [], self.cleared + 1


def log_of(events: int) -> MemoryEventStore:
    store = MemoryEventStore()
    more(store, events)
    return store


def more(store: MemoryEventStore, events: int) -> None:
    version = len(store.load(STREAM))
    new = tuple(NewEvent(kind="Moved", body=b"{}") for _ in range(events))
    store.append([Batch(stream=STREAM, expected_version=version, events=new)], [], NOW)


def follower(target: Positions, store: MemoryEventStore, batch: int = 3) -> Follower:
    return Follower(target, head=store.head, read=store.read, fold="f", batch=batch)


def test_everything_is_taken_once_and_in_order_a_stretch_at_a_time() -> None:
    store, target = log_of(7), Positions(beginning("f"))
    mark = follower(target, store).catch_up()
    assert [position for stretch in target.seen for position in stretch] == [1, 2, 3, 4, 5, 6, 7]
    assert max(len(stretch) for stretch in target.seen) <= 3
    assert (mark.position, mark.digest) == (7, store.head().digest)
    more(store, 1)
    follower(target, store).catch_up()
    assert target.seen[-1] == [8] and target.cleared == 0


def test_an_empty_log_is_followed_to_its_beginning() -> None:
    target = Positions(beginning("f"))
    assert follower(target, MemoryEventStore()).catch_up() == beginning("f")
    assert target.seen == []


def test_at_the_head_nothing_is_read() -> None:
    store = log_of(2)
    target = Positions(beginning("f"))
    follower(target, store).catch_up()

    def read(after: int, limit: int) -> list[StoredEvent]:
        raise AssertionError("nothing is new")

    mark = Follower(target, head=store.head, read=read, fold="f").catch_up()
    assert (mark.position, target.seen) == (2, [[1, 2]])


@pytest.mark.parametrize(
    "foreign",
    [
        FollowPosition(fold="f", position=2, digest=Digest("ab" * 32)),
        FollowPosition(fold="f", position=9, digest=Digest("ab" * 32)),
        FollowPosition(fold="older", position=2, digest=Digest("")),
    ],
    ids=["another log", "a longer log", "another fold"],
)
def test_what_was_made_of_another_log_or_by_another_fold_is_made_anew(foreign: FollowPosition) -> None:
    store, target = log_of(4), Positions(foreign)
    assert follower(target, store).catch_up().position == 4
    assert target.cleared == 1
    assert [position for stretch in target.seen for position in stretch] == [1, 2, 3, 4]


def test_where_another_process_was_faster_the_mark_is_asked_for_again() -> None:
    store = log_of(4)

    class Raced(Positions):
        def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
            super().take(fresh, after=after, upto=upto)
            if len(self.seen) == 1:
                raise ConcurrencyConflict("taken elsewhere", where="here", do="look again")

    target = Raced(beginning("f"))
    assert follower(target, store).catch_up().position == 4
    assert target.seen == [[1, 2, 3], [4]]


def test_what_fails_to_be_taken_is_taken_again_the_next_time() -> None:
    store = log_of(2)

    class Failing(Positions):
        def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
            if not self.cleared:
                self.cleared = 1
                raise StoreUnavailable("the disk is full", where="here", do="free some space")
            super().take(fresh, after=after, upto=upto)

    target = Failing(beginning("f"))
    with pytest.raises(StoreUnavailable):
        follower(target, store).catch_up()
    assert follower(target, store).catch_up().position == 2
    assert target.seen == [[1, 2]]
