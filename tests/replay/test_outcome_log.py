"""An auditor folds what routing was told of a provider from the verdicts of the whole log."""

from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from harness.auditing.outcomes import OutcomeLog
from harness.contracts.memory import OutcomeSums
from harness.memory.fabric import MemoryFabric
from harness.routing.history import SettingHistory
from tests.builders.gate import CONFIGURATION
from tests.unit.memory.building import Log
from tests.unit.memory.test_disputes import dispute_arrival
from tests.unit.planning.building import card

HALF_LIFE = 20.0
ABLE = card("p1")


def told(log: Log, memory: MemoryFabric) -> SettingHistory:
    """What a dispatch would be told now."""
    known = memory.history(ABLE, place="dock", configuration=CONFIGURATION, half_life=HALF_LIFE)
    return SettingHistory(
        provider_id=ABLE.provider_id,
        capability=ABLE.capability,
        place="dock",
        configuration=CONFIGURATION,
        sums=known.sums,
        position=known.position,
    )


def audit(log: Log) -> OutcomeLog:
    return OutcomeLog(read=log.store.read, stream=log.store.load, same_contract=log.memory.of_same_contract)


def differences(log: Log, stored: Sequence[SettingHistory]) -> list[OutcomeSums | None]:
    """Of every stored sum, as an auditor meets them who reads the log once."""
    outcomes = audit(log)
    return [outcomes.differs(one, ABLE, half_life=HALF_LIFE) for one in stored]


def history() -> tuple[Log, list[SettingHistory]]:
    """A log with a refutation, a second look, a dispute and another provider, and what was told after each."""
    log, stored = Log(), []
    running, restarted = log.memory, MemoryFabric(store=log.store, index=log.index)
    for number, (word, provider) in enumerate((("satisfied", "p1"), ("violated", "p1"), ("satisfied", "p2")) * 3):
        mission_id = log.begin(f"msn_{number}")
        log.went(mission_id, word, provider=provider)  # type: ignore[arg-type]
        stored.append(told(log, running))
        if word == "violated":
            log.looked_again(mission_id)
            log.judged(mission_id, "violated")
        elif number == 3:
            dispute_arrival(log, mission_id)
        stored += [told(log, running), told(log, restarted)]
    return log, stored


@pytest.mark.ledger("R146", symbol="harness.auditing.outcomes:OutcomeLog.differs")
def test_sums_that_follow_from_the_log_are_derived_again_in_whatever_order_they_are_met() -> None:
    log, stored = history()
    assert len({one.sums.failed for one in stored}) > 4
    assert differences(log, stored) == [None] * len(stored)
    assert differences(log, stored[::-1]) == [None] * len(stored)


@pytest.mark.ledger("R146", symbol="harness.auditing.outcomes:OutcomeLog.differs")
@pytest.mark.parametrize("change", [{"failed": 0.0}, {"weight": 9.0}, {"judged": 99}, {"refuted": 99}])
def test_sums_that_do_not_follow_from_the_log_are_named_with_what_it_says(change: dict[str, float]) -> None:
    log, stored = history()
    forged = replace(stored[-1], sums=replace(stored[-1].sums, **change))
    assert differences(log, [forged]) == [stored[-1].sums]


def test_sums_as_of_an_earlier_event_are_not_those_of_a_later_one() -> None:
    log, stored = history()
    early = replace(stored[-1], position=stored[0].position)
    assert differences(log, [early]) == [stored[0].sums]
