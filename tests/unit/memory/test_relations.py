"""How records stand to each other: nothing is overwritten, and a contradiction is withheld until it is settled."""

import pytest
from msgspec.structs import replace

from harness.contracts.memory import MemoryQuery
from harness.contracts.values import encode
from harness.memory.spatial import SIGHTING_HOLDS_S
from tests.unit.memory.building import Log


def standings(log: Log) -> list[tuple[str, str]]:
    """Who says what of the passage, and what became of it, oldest first."""
    return [(one.record.provenance.sources[-1], one.standing) for one in log.found("sighting")]


def admitted(log: Log) -> list[tuple[str, float]]:
    """What a role may be told of the passage."""
    found = log.memory.find(MemoryQuery(kinds=("sighting",), subject="passage/gap"))
    return [(one.standing, one.record.knowledge.states["blocked"]) for one in found]  # type: ignore[union-attr]


@pytest.mark.ledger("R142", symbol="harness.memory.relations:relate")
def test_a_newer_record_supersedes_an_older_one_and_both_stay() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    (first,) = log.found("sighting")
    log.sighted("msn_b", blocked=0.0, provider="eye")
    old, new = log.found("sighting")
    assert new.record.supersedes == (first.record.record_id,) and new.record.conflicts == ()
    assert encode(old.record) == encode(first.record)
    assert (old.standing, new.standing) == ("superseded", "observed")


@pytest.mark.ledger("R69", symbol="harness.memory.relations:relate")
@pytest.mark.ledger("R142", symbol="harness.memory.relations:relate")
def test_two_sources_that_contradict_each_other_are_both_withheld_until_one_is_confirmed() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    log.sighted("msn_b", blocked=0.0, provider="lidar")
    assert standings(log) == [("eye", "disputed"), ("lidar", "disputed")]
    assert admitted(log) == []
    log.sighted("msn_c", blocked=0.0, provider="second-eye")
    assert standings(log) == [("eye", "superseded"), ("lidar", "superseded"), ("second-eye", "verified")]
    assert admitted(log) == [("verified", 0.0)]


def test_the_same_source_saying_it_again_settles_nothing() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    log.sighted("msn_b", blocked=0.0, provider="lidar")
    log.sighted("msn_c", blocked=1.0, provider="eye")
    assert standings(log) == [("eye", "superseded"), ("lidar", "disputed"), ("eye", "disputed")]
    assert admitted(log) == []


def test_a_source_that_changes_its_mind_confirms_the_other() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    log.sighted("msn_b", blocked=0.0, provider="lidar")
    log.sighted("msn_c", blocked=0.0, provider="eye")
    assert admitted(log) == [("verified", 0.0)]


def test_two_sources_that_agree_make_a_sighting_verified() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    log.sighted("msn_b", blocked=1.0, provider="lidar")
    assert admitted(log) == [("verified", 1.0)]


def test_what_expired_is_contradicted_by_nothing() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    log.clock.at_s += 2 * SIGHTING_HOLDS_S
    log.sighted("msn_b", blocked=0.0, provider="lidar")
    assert admitted(log) == [("observed", 0.0)]


def test_a_conflict_inside_one_stretch_of_the_log_is_the_same_as_one_found_step_by_step() -> None:
    at_once, stepwise = Log(), Log()
    for name, blocked, provider in (("a", 1.0, "eye"), ("b", 0.0, "lidar"), ("c", 1.0, "eye"), ("d", 0.0, "x")):
        at_once.sighted(name, blocked=blocked, provider=provider)
        stepwise.sighted(name, blocked=blocked, provider=provider)
        stepwise.memory.catch_up()
    assert encode(at_once.found()) == encode(stepwise.found())
    assert replace(at_once.found()[0], standing="observed") != at_once.found()[0]
