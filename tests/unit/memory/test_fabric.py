"""The fabric: a projection of the log that can be lost, cut off or raced, and is the same again."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.contracts.errors import LogDamaged, UnknownName
from harness.contracts.ids import StreamId, mission_stream
from harness.contracts.memory import FollowPosition, KnownPose, MemoryQuery, MemoryRecord
from harness.contracts.ports import Batch, MemoryIndex, NewEvent
from harness.contracts.values import Moment, decode, encode
from harness.followers import BATCH
from harness.memory.fabric import MemoryFabric
from harness.memory.fold import FOLD
from tests.builders.gate import CONFIGURATION, GO
from tests.saying import raises_saying
from tests.unit.memory.building import EVERY_STANDING, EVERYTHING, Log
from tests.unit.planning.building import card


def eventful() -> Log:
    """Missions with successes, refutations, second looks, a conflict and a card."""
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    log.sighted("msn_b", blocked=0.0, provider="lidar")
    looked = log.begin("msn_c")
    log.went(looked, "violated", distance_m=1.0)
    log.looked_again(looked)
    log.judged(looked, "violated", distance_m=1.0)
    log.shown(log.begin("msn_d"), card("route-follower"))
    return log


def everything(index: MemoryIndex, **changes: object) -> bytes:
    """Every record and its standing, as canonical bytes."""
    fields: dict[str, object] = {"kinds": EVERYTHING, "standings": EVERY_STANDING, "limit": 10_000}
    return encode(index.find(MemoryQuery(**(fields | changes))))  # type: ignore[arg-type]


@pytest.mark.ledger("R141", symbol="harness.memory.draft:provenance")
def test_every_record_names_its_event_its_evidence_its_sources_and_how_far_it_may_be_used() -> None:
    log = eventful()
    found = log.found()
    assert len(found) > 20
    for one in found:
        record, source = one.record, one.record.provenance
        (event,) = log.store.read(source.position - 1, 1)
        assert (event.position, event.stream) == (source.position, source.stream)
        assert source.stream == mission_stream(source.mission_id)
        assert source.sources and 0.0 <= record.confidence <= 1.0
        assert record.valid_until_s is None or record.valid_until_s > record.valid_from_s
        assert record.verification in ("configured", "observed", "verified", "disputed")
        if record.role in ("episodic", "operational"):
            assert source.packet_id in {
                packet.identity.packet_id
                for state in log.mission(source.mission_id).nodes.values()
                for packet in state.packets
            }


@pytest.mark.parametrize("field", ["provenance", "confidence", "valid_from_s", "valid_until_s", "verification"])
def test_a_record_without_one_of_them_cannot_be_read(field: str) -> None:
    fields = decode(encode(eventful().found()[0].record), dict)
    fields.pop(field)
    with pytest.raises(msgspec.ValidationError, match=field):
        decode(encode(fields), MemoryRecord)


@pytest.mark.ledger("R135", symbol="harness.memory.fold:Fold.advance")
def test_what_was_current_at_an_earlier_decision_can_still_be_told() -> None:
    log = Log()
    log.went(log.begin("msn_a"), distance_m=0.1)
    then = log.store.head().position
    log.went(log.begin("msn_b"), distance_m=0.3)

    def within_m(as_of: int | None) -> list[float | None]:
        found = log.memory.find(MemoryQuery(kinds=("pose",), subject="robot/vbot-1", as_of=as_of))
        return [one.record.knowledge.within_m for one in found if isinstance(one.record.knowledge, KnownPose)]

    assert within_m(None) == [0.3]
    assert within_m(then) == [0.1]
    assert within_m(1) == []


@pytest.mark.ledger("R135", symbol="harness.memory.relations:relate")
def test_the_same_log_gives_the_same_memory_byte_for_byte(tmp_path: Path) -> None:
    log = eventful()
    log.memory.catch_up()
    again, in_file = VolatileMemoryIndex(), SqlMemoryIndex(f"sqlite:///{tmp_path / 'memory.db'}")
    for index in (again, in_file):
        MemoryFabric(store=log.store, index=index).catch_up()
        assert everything(index) == everything(log.index)
        assert everything(index, as_of=20) == everything(log.index, as_of=20)
        assert index.mark() == log.index.mark()
    in_file.close()


def test_a_restart_in_the_middle_of_every_step_changes_nothing() -> None:
    whole = eventful()
    whole.memory.catch_up()
    half = VolatileMemoryIndex()
    for position in range(1, whole.store.head().position + 1):
        MemoryFabric(store=_cut(whole, position), index=half).catch_up()
    assert everything(half) == everything(whole.index)
    assert half.mark() == whole.index.mark()


def test_answers_include_what_was_committed_just_before_the_question() -> None:
    log = Log()
    mission_id = log.begin()
    log.memory.catch_up()
    log.went(mission_id)
    assert len(log.memory.find(MemoryQuery(kinds=("outcome",)))) == 1


@pytest.mark.parametrize("change", ["fold", "log"])
def test_an_index_of_another_fold_or_another_log_is_built_again(change: str) -> None:
    log, other = eventful(), Log()
    other.sighted("msn_x", blocked=1.0, provider="eye")
    other.memory.catch_up()
    mark = other.index.mark()
    if change == "fold":
        stranger = VolatileMemoryIndex()
        stranger.add([], after=stranger.mark(), upto=replace(_mark_of(log), fold="0"))
    else:
        assert mark.position < log.store.head().position
        stranger = other.index
    MemoryFabric(store=log.store, index=stranger).catch_up()
    log.memory.catch_up()
    assert everything(stranger) == everything(log.index)


def test_an_index_that_is_ahead_of_a_restored_log_is_built_again() -> None:
    log = eventful()
    log.memory.catch_up()
    shorter = _cut(log, 12)
    fresh = VolatileMemoryIndex()
    MemoryFabric(store=shorter, index=fresh).catch_up()
    MemoryFabric(store=shorter, index=log.index).catch_up()
    assert everything(log.index) == everything(fresh)


def test_two_followers_of_one_index_leave_every_record_once() -> None:
    log = eventful()
    raced = Overtaken(log.index, lambda: MemoryFabric(store=log.store, index=log.index).catch_up())
    mark = MemoryFabric(store=log.store, index=raced).catch_up()
    alone = VolatileMemoryIndex()
    MemoryFabric(store=log.store, index=alone).catch_up()
    assert raced.overtaken == 1
    assert everything(log.index) == everything(alone)
    assert mark == alone.mark()


def test_a_log_longer_than_one_batch_is_followed_to_its_end() -> None:
    log = Log()
    mission_id = log.begin()
    for index in range(BATCH // 4 + 5):
        log.went(log.begin(f"msn_{index}"))
    assert log.store.head().position > BATCH
    assert log.memory.catch_up().position == log.store.head().position
    log.went(mission_id)
    assert len(log.memory.find(MemoryQuery(kinds=("outcome",), limit=1000))) == BATCH // 4 + 6


def test_leases_and_handoffs_leave_no_records() -> None:
    log = Log()
    body = encode({"kind": "LeaseReleased"})
    batch = Batch(stream=StreamId("lease/base"), expected_version=0, events=(NewEvent(kind="x", body=body),))
    log.store.append([batch], [], Moment(mission_s=0.0, wall_s=0.0))
    assert log.memory.catch_up().position == 1
    assert log.found() == []


def test_an_event_that_cannot_be_read_is_named_and_nothing_is_remembered_of_it() -> None:
    log = Log()
    log.begin()
    log.memory.catch_up()
    stream = mission_stream(log.begin("msn_b"))
    broken = Batch(stream=stream, expected_version=3, events=(NewEvent(kind="x", body=b'{"kind":"Surprise"}'),))
    log.store.append([broken], [], Moment(mission_s=0.0, wall_s=0.0))
    before = log.index.mark()
    with raises_saying(LogDamaged, match="position 7"):
        log.memory.catch_up()
    assert log.index.mark() == before


def test_a_record_is_found_by_its_name_and_an_unknown_name_is_an_error() -> None:
    log = Log()
    log.dispatched(log.begin(), GO)
    record = log.found()[0].record
    assert log.memory.get(record.record_id).record == record
    with raises_saying(UnknownName, match="mem_none"):
        log.memory.get("mem_none")


def test_a_dispatch_is_answered_at_the_head_of_the_log_and_the_index_follows_when_it_is_asked() -> None:
    log = Log()
    memory = MemoryFabric(store=log.store, index=log.index)
    log.went(log.begin("msn_a"), "violated")
    assert _weight(memory) == 1.0
    at = log.index.mark()
    log.went(log.begin("msn_b"), "violated")
    assert 1.9 < _weight(memory) < 2.0
    assert log.index.mark() == at
    assert len(memory.find(MemoryQuery(kinds=("outcome",)))) == 2
    assert log.index.mark() == _mark_of(log)


def test_an_index_that_another_follower_took_further_is_followed_from_there() -> None:
    log = Log()
    memory = MemoryFabric(store=log.store, index=log.index)
    memory.catch_up()
    log.went(log.begin("msn_a"))
    MemoryFabric(store=log.store, index=log.index).catch_up()
    log.went(log.begin("msn_b"))
    assert len(memory.find(MemoryQuery(kinds=("outcome",)))) == 2
    alone = VolatileMemoryIndex()
    MemoryFabric(store=log.store, index=alone).catch_up()
    assert everything(log.index) == everything(alone)


class Overtaken:
    """An index that another follower takes to the end of the log just before the first answer is written."""

    def __init__(self, index: MemoryIndex, overtake: Callable[[], object]) -> None:
        self._index = index
        self._overtake = overtake
        self.overtaken = 0
        self.mark, self.clear, self.get = index.mark, index.clear, index.get
        self.current, self.find, self.close = index.current, index.find, index.close

    def add(self, records: Sequence[MemoryRecord], *, after: FollowPosition, upto: FollowPosition) -> None:
        if not self.overtaken:
            self.overtaken += 1
            self._overtake()
        self._index.add(records, after=after, upto=upto)


def _weight(memory: MemoryFabric) -> float:
    """What routing is told before a dispatch: how much is known."""
    return memory.history(card("p1"), place="dock", configuration=CONFIGURATION, half_life=20.0).sums.weight


def _mark_of(log: Log) -> FollowPosition:
    head = log.store.head()
    return FollowPosition(fold=FOLD, position=head.position, digest=head.digest)


def _cut(log: Log, position: int) -> MemoryEventStore:
    """The first events of a log, with the artefacts of all of it."""
    store = MemoryEventStore()
    events = log.store.read(0, position)
    for event in events:
        new = NewEvent(kind=event.kind, body=event.body)
        batch = Batch(stream=event.stream, expected_version=event.version - 1, events=(new,))
        store.append([batch], log.records, Moment(mission_s=event.mission_s, wall_s=event.recorded_s))
    assert store.head() == type(store.head())(position=events[-1].position, digest=events[-1].digest)
    return store


def test_questions_from_many_threads_leave_every_record_once(tmp_path: Path) -> None:
    log = eventful()
    with closing(SqlMemoryIndex(f"sqlite:///{tmp_path / 'memory.db'}")) as index, ThreadPoolExecutor(6) as pool:
        memory = MemoryFabric(store=log.store, index=index)
        query = MemoryQuery(kinds=EVERYTHING, standings=EVERY_STANDING, limit=10_000)
        answers = list(pool.map(lambda _: encode(memory.find(query)), range(24)))
        log.memory.catch_up()
        assert set(answers) == {everything(log.index)}
