"""Every memory index answers the same: in the process and in an SQLite file."""

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from random import Random

import pytest
from msgspec.structs import replace

from harness.adapters.stores.memory_index import EMPTY, VolatileMemoryIndex
from harness.adapters.stores.memory_index_sql import SqlMemoryIndex
from harness.contracts.errors import ConcurrencyConflict, StoreUnavailable, UnknownName
from harness.contracts.ids import Digest, MissionId, ProviderId, RobotId, StreamId
from harness.contracts.memory import (
    AnyKnowledge,
    FloorBox,
    FollowPosition,
    KnownPose,
    MemoryQuery,
    MemoryRecord,
    Provenance,
    ProviderOutcome,
    RecordStanding,
    Sighting,
)
from harness.contracts.ports import MemoryIndex
from harness.contracts.values import encode
from harness.contracts.verdicts import Verdict
from tests.saying import raises_saying

START_S = 1_790_000_000.0
SETTING = Digest("c" * 64)
ALL: tuple[RecordStanding, ...] = ("configured", "observed", "verified", "disputed", "superseded")


@pytest.fixture(params=["volatile", "sqlite"])
def index(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[MemoryIndex]:
    opened: Callable[[], MemoryIndex] = (
        VolatileMemoryIndex
        if request.param == "volatile"
        else lambda: SqlMemoryIndex(f"sqlite:///{tmp_path / 'memory.db'}")
    )
    with closing(opened()) as one:
        yield one


def mark(position: int) -> FollowPosition:
    return FollowPosition(fold="1", position=position, digest=Digest(f"{position:064x}"))


def box(x_m: float, y_m: float, size_m: float = 1.0, map_version: str = "m1") -> FloorBox:
    return FloorBox(
        frame="map", map_version=map_version, x_min_m=x_m, y_min_m=y_m, x_max_m=x_m + size_m, y_max_m=y_m + size_m
    )


def record(position: int, knowledge: AnyKnowledge | None = None, **changes: object) -> MemoryRecord:
    """A verified pose that speaks from `position` seconds after the start on."""
    source = Provenance(
        position=position, stream=StreamId("mission/m"), mission_id=MissionId("msn_a"), sources=("localiser",)
    )
    plain = MemoryRecord(
        record_id=f"mem_{position}",
        role="spatial",
        subject="robot/r",
        knowledge=knowledge or KnownPose(robot_id=RobotId("r"), point_m=(float(position), 0.0)),
        confidence=0.9,
        valid_from_s=START_S + position,
        valid_until_s=None,
        verification="verified",
        provenance=source,
    )
    return replace(plain, **changes)


def outcome(
    position: int, *, provider: str = "p1", verdict: Verdict = "satisfied", place: str = "dock"
) -> MemoryRecord:
    said = ProviderOutcome(
        provider_id=ProviderId(provider),
        provider_version="1",
        capability="navigate",
        place=place,
        configuration=SETTING,
        parameters={"target": (1.0, 2.0)},
        verdict=verdict,
        residual=0.25,
        duration_s=30.0,
        measured={"distance_m": 0.1},
    )
    return record(position, said, subject=f"outcome/{position}", role="operational")


def fill(index: MemoryIndex, records: Sequence[MemoryRecord]) -> None:
    """Add records one at a time, each with its own mark."""
    for one in records:
        index.add([one], after=index.mark(), upto=mark(one.provenance.position))


def names(index: MemoryIndex, *kinds: str, **changes: object) -> list[int]:
    """The positions of the records found, newest first."""
    query = MemoryQuery(kinds=kinds or ("pose", "outcome", "sighting"), **changes)  # type: ignore[arg-type]
    return [one.record.provenance.position for one in index.find(query)]


def test_an_empty_index_holds_nothing_and_stands_at_zero(index: MemoryIndex) -> None:
    assert index.mark() == EMPTY
    assert names(index) == [] and index.current("pose", "robot/r") == []
    with raises_saying(UnknownName, match="mem_7"):
        index.get("mem_7")


def test_what_was_added_is_read_back_as_it_was(index: MemoryIndex) -> None:
    kept = [record(1, where=box(0.0, 0.0), valid_until_s=START_S + 99.0), outcome(2)]
    index.add(kept, after=EMPTY, upto=mark(2))
    assert index.mark() == mark(2)
    for one in kept:
        found = index.get(one.record_id)
        assert encode(found.record) == encode(one)
        assert (found.standing, found.until_s) == ("verified", one.valid_until_s)


def test_only_a_follower_that_stands_where_the_index_stands_may_add(index: MemoryIndex) -> None:
    index.add([record(1)], after=EMPTY, upto=mark(1))
    for wrong in (EMPTY, mark(2), replace(mark(1), digest=Digest("f" * 64)), replace(mark(1), fold="2")):
        with pytest.raises(ConcurrencyConflict):
            index.add([record(2)], after=wrong, upto=mark(2))
    assert names(index) == [1] and index.mark() == mark(1)


def test_an_index_can_be_emptied_and_filled_again(index: MemoryIndex) -> None:
    fill(index, [record(1, where=box(0.0, 0.0)), record(2, supersedes=("mem_1",), where=box(1.0, 0.0))])
    index.clear()
    assert index.mark() == EMPTY and names(index, standings=ALL) == []
    fill(index, [record(1, where=box(0.0, 0.0))])
    assert names(index, region=box(-1.0, -1.0, 5.0)) == [1]


def test_a_superseded_record_stays_with_its_validity_cut_short(index: MemoryIndex) -> None:
    first, second = record(1), record(5, supersedes=("mem_1",))
    fill(index, [first, second])
    old = index.get("mem_1")
    assert (old.standing, old.until_s) == ("superseded", second.valid_from_s)
    assert encode(old.record) == encode(first)
    assert [one.record for one in index.current("pose", "robot/r")] == [second]
    assert names(index) == [5] and names(index, standings=ALL) == [5, 1]
    assert names(index, standings=("superseded",)) == [1]


def test_a_validity_that_ended_earlier_is_not_made_longer(index: MemoryIndex) -> None:
    fill(index, [record(1, valid_until_s=START_S + 2.0), record(5, supersedes=("mem_1",))])
    assert index.get("mem_1").until_s == START_S + 2.0


def test_both_sides_of_a_conflict_are_withheld_and_both_are_current(index: MemoryIndex) -> None:
    one = record(1, Sighting(states={"blocked": 1.0}), verification="observed", subject="gap")
    two = record(2, Sighting(states={"blocked": 0.0}), verification="disputed", subject="gap", conflicts=("mem_1",))
    fill(index, [one, two])
    assert [found.standing for found in index.current("sighting", "gap")] == ["disputed", "disputed"]
    assert names(index) == [] and names(index, standings=("disputed",)) == [2, 1]
    fill(index, [record(3, Sighting(states={"blocked": 0.0}), subject="gap", supersedes=("mem_1", "mem_2"))])
    assert names(index) == [3] and names(index, standings=("disputed",)) == []


def test_an_earlier_position_of_the_log_is_answered_with_what_was_known_then(index: MemoryIndex) -> None:
    fill(index, [record(1), record(4, supersedes=("mem_1",)), record(7, conflicts=("mem_4",), verification="disputed")])
    assert [names(index, as_of=position) for position in (0, 1, 3, 4, 6, 7)] == [[], [1], [1], [4], [4], []]
    (then,) = index.find(MemoryQuery(kinds=("pose",), as_of=2))
    assert (then.standing, then.until_s) == ("verified", None)
    assert names(index, as_of=3, valid_at_s=START_S + 50.0) == [1]
    assert names(index, as_of=3, standings=("superseded",)) == []
    assert names(index, as_of=4, standings=("superseded",)) == [1]
    assert names(index, as_of=7, standings=("disputed",)) == [7, 4]


def test_only_what_speaks_for_an_instant_is_found(index: MemoryIndex) -> None:
    fill(index, [record(10, valid_until_s=START_S + 20.0), record(15), record(30, supersedes=("mem_15",))])
    for after_s, expected in ((9.9, []), (10.0, [10]), (16.0, [15, 10]), (20.0, [15]), (29.9, [15]), (30.0, [30])):
        assert names(index, valid_at_s=START_S + after_s, standings=ALL) == expected
    assert names(index, valid_at_s=START_S + 16.0) == [10]


def test_a_region_is_answered_with_what_touches_it_on_the_same_map(index: MemoryIndex) -> None:
    fill(
        index,
        [
            record(1, where=box(0.0, 0.0), subject="a"),
            record(2, where=box(5.0, 5.0), subject="b"),
            record(3, where=box(0.5, 0.5), subject="c"),
            record(4, where=box(0.0, 0.0, map_version="m2"), subject="d"),
            record(5, subject="e"),
        ],
    )
    assert names(index, region=box(0.9, 0.9, 0.2)) == [3, 1]
    assert names(index, region=box(1.0, 1.0, 0.1)) == [3, 1]
    assert names(index, region=box(1.51, 0.0, 0.1)) == []
    assert names(index, region=box(-9.0, -9.0, 20.0)) == [3, 2, 1]
    assert names(index, region=box(-9.0, -9.0, 20.0, "m2")) == [4]


def test_a_region_at_an_instant_leaves_out_what_had_ended(index: MemoryIndex) -> None:
    fill(
        index,
        [
            record(1, where=box(0.0, 0.0)),
            record(500, where=box(0.0, 0.0), supersedes=("mem_1",)),
            record(501, where=box(0.0, 0.0), subject="x", valid_until_s=START_S + 600.0),
        ],
    )
    region = box(0.0, 0.0)
    assert names(index, region=region, valid_at_s=START_S + 499.0, standings=ALL) == [1]
    assert names(index, region=region, valid_at_s=START_S + 550.0) == [501, 500]
    assert names(index, region=region, valid_at_s=START_S + 601.0) == [500]
    assert names(index, region=region, valid_at_s=START_S + 499.0, as_of=499) == [1]


def test_provider_history_is_found_by_its_setting_newest_first(index: MemoryIndex) -> None:
    fill(
        index,
        [
            outcome(1),
            outcome(2, verdict="violated"),
            outcome(3, provider="p2"),
            outcome(4, place="hall"),
            outcome(5),
            outcome(6),
        ],
    )
    setting = {"provider_id": "p1", "capability": "navigate", "place": "dock", "configuration": SETTING}
    assert names(index, "outcome", **setting) == [6, 5, 2, 1]
    assert names(index, "outcome", **setting, limit=2) == [6, 5]
    assert names(index, "outcome", **setting, verdicts=("violated", "unsafe")) == [2]
    assert names(index, "outcome", provider_id="p1") == [6, 5, 4, 2, 1]
    assert names(index, "outcome", place="") == []
    assert names(index, "outcome", configuration="d" * 64) == []
    assert names(index, "pose", provider_id="p1") == []


def test_missions_and_low_confidence_narrow_an_answer(index: MemoryIndex) -> None:
    other = replace(record(2).provenance, mission_id=MissionId("msn_b"))
    fill(index, [record(1, confidence=0.4), record(2, provenance=other)])
    assert names(index, mission_id="msn_b") == [2]
    assert names(index, minimum_confidence=0.5) == [2]
    assert names(index, subject="robot/other") == []


def random_records(seed: int, count: int = 120) -> list[MemoryRecord]:
    """Records that supersede and contradict earlier ones at random."""
    draw, made = Random(seed), list[MemoryRecord]()
    current: list[str] = []
    for position in range(1, count + 1):
        one = outcome(position, provider=draw.choice(("p1", "p2")), verdict=draw.choice(("satisfied", "violated")))
        if draw.random() < 0.6:
            where = box(draw.uniform(-9, 9), draw.uniform(-9, 9), draw.uniform(0, 3))
            ends = draw.choice((None, START_S + position + draw.uniform(1, 60)))
            one = record(position, where=where, valid_until_s=ends, subject=f"robot/{draw.randrange(3)}")
        ended = tuple(draw.sample(current, k=min(len(current), draw.choice((0, 0, 1, 2)))))
        left = [name for name in current if name not in ended]
        torn = tuple(draw.sample(left, k=1)) if len(left) > 4 and draw.random() < 0.2 else ()
        verification = "disputed" if torn else draw.choice(("observed", "verified"))
        made.append(replace(one, supersedes=ended, conflicts=torn, verification=verification))
        current = [*left, one.record_id]
    return made


def random_query(draw: Random) -> MemoryQuery:
    standings = draw.sample(ALL, k=draw.randint(1, 5))
    return MemoryQuery(
        kinds=tuple(draw.sample(("pose", "outcome", "sighting"), k=draw.randint(1, 3))),
        subject=draw.choice(("", "", "", "robot/1")),
        provider_id=draw.choice(("", "", "", "p1")),
        place=draw.choice((None, None, None, "dock", "")),
        verdicts=draw.choice(((), (), ("satisfied",), ("violated", "unsafe"))),
        region=draw.choice((None, None, box(draw.uniform(-9, 5), draw.uniform(-9, 5), draw.uniform(0, 9)))),
        valid_at_s=draw.choice((None, START_S + draw.uniform(0, 150))),
        as_of=draw.choice((None, None, draw.randint(0, 130))),
        standings=tuple(standings),
        minimum_confidence=draw.choice((0.0, 0.5)),
        limit=draw.choice((1, 7, 1000)),
    )


@pytest.mark.parametrize("seed", range(4))
def test_both_indices_answer_every_question_alike(seed: int, tmp_path: Path) -> None:
    draw, made = Random(seed), random_records(seed)
    volatile = VolatileMemoryIndex()
    with closing(SqlMemoryIndex(f"sqlite:///{tmp_path / 'memory.db'}")) as in_file:
        for index in (volatile, in_file):
            index.add(made[:50], after=EMPTY, upto=mark(50))
            index.add(made[50:], after=mark(50), upto=mark(120))
        answered = 0
        for _ in range(250):
            query = random_query(draw)
            expected = volatile.find(query)
            assert encode(in_file.find(query)) == encode(expected), query
            answered += bool(expected)
        assert answered > 60
        for subject in ("robot/0", "robot/1", "robot/2"):
            assert in_file.current("pose", subject) == volatile.current("pose", subject)


def test_the_file_is_found_again_where_it_was_left(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'memory.db'}"
    with closing(SqlMemoryIndex(url)) as index:
        fill(index, [record(1), record(2, supersedes=("mem_1",))])
    with closing(SqlMemoryIndex(url)) as index:
        assert index.mark() == mark(2) and names(index) == [2]
    with raises_saying(StoreUnavailable, match="closed"):
        index.mark()


def test_a_file_of_another_schema_is_emptied_because_the_log_can_fill_it_again(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'memory.db'}"
    with closing(SqlMemoryIndex(url)) as index:
        fill(index, [record(1)])
    with closing(sqlite3.connect(tmp_path / "memory.db")) as stranger:
        stranger.execute("PRAGMA user_version=99")
    with closing(SqlMemoryIndex(url)) as index:
        assert index.mark() == EMPTY and names(index, standings=ALL) == []


def test_a_file_that_is_no_database_is_an_error_that_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "memory.db").write_bytes(b"not a database at all, but long enough to be looked at" * 40)
    with raises_saying(StoreUnavailable, match="delete this file") as caught:
        SqlMemoryIndex(f"sqlite:///{tmp_path / 'memory.db'}")
    assert caught.value.where == str(tmp_path / "memory.db")
