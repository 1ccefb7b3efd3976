"""Answers about outcomes that are kept from dispatch to dispatch are those the index would give."""

import pytest

from harness.contracts.ids import Digest, ProviderId
from harness.contracts.memory import MemoryRecord
from harness.memory.fabric import MemoryFabric
from tests.builders.gate import CONFIGURATION
from tests.unit.memory.building import Log

PROVIDERS = ("p1", "p2", "observer")


def outcomes(memory: MemoryFabric, *, limit: int) -> list[list[MemoryRecord]]:
    """What every provider is known for, by every setting that the log has."""
    return [
        memory.outcomes(
            ProviderId(provider), capability="navigate", place=place, configuration=Digest(CONFIGURATION), limit=limit
        )
        for provider in PROVIDERS
        for place in ("", "dock")
    ]


@pytest.mark.parametrize("limit", [2, 200])
def test_kept_answers_are_the_answers_of_the_index(limit: int) -> None:
    log = Log()
    seen = set()

    def compare() -> None:
        kept = outcomes(log.memory, limit=limit)
        assert kept == outcomes(MemoryFabric(store=log.store, index=log.index), limit=limit)
        seen.add(sum(map(len, kept)))

    for number, (word, provider) in enumerate((("satisfied", "p1"), ("violated", "p1"), ("ambiguous", "p2")) * 2):
        mission_id = log.begin(f"msn_{number}")
        log.dispatched(mission_id, provider=provider)
        compare()
        log.judged(mission_id, word)  # type: ignore[arg-type]
        compare()
        if word != "satisfied":
            log.looked_again(mission_id)
            log.judged(mission_id, "violated")
            compare()
    assert len(seen) > 2


def test_what_another_follower_brought_into_the_index_is_answered_too() -> None:
    log = Log()
    log.went(log.begin("msn_a"))
    assert sum(map(len, outcomes(log.memory, limit=10))) == 1
    log.went(log.begin("msn_b"))
    MemoryFabric(store=log.store, index=log.index).catch_up()
    log.went(log.begin("msn_c"))
    assert sum(map(len, outcomes(log.memory, limit=10))) == 3


def test_a_lost_index_is_built_again_before_it_answers() -> None:
    log = Log()
    log.went(log.begin("msn_a"))
    before = outcomes(log.memory, limit=10)
    log.index.clear()
    assert outcomes(log.memory, limit=10) == before
