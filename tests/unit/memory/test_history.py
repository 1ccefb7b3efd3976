"""What routing is told of a provider follows every verdict, and is what the whole log says when it is folded anew."""

import pytest

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import MissionId
from harness.contracts.memory import OutcomeSums
from harness.contracts.verdicts import Verdict
from harness.memory.fabric import MemoryFabric
from harness.memory.outcomes import SettingOutcomes
from tests.builders.gate import CONFIGURATION
from tests.unit.memory.building import Log
from tests.unit.memory.test_disputes import dispute_arrival
from tests.unit.planning.building import card

HALF_LIFE = 20.0
PROVIDERS = ("p1", "p2", "observer")


def asked(memory: MemoryFabric, able: CapabilityCard | None = None, place: str = "dock") -> SettingOutcomes:
    return memory.history(able or card("p1"), place=place, configuration=CONFIGURATION, half_life=HALF_LIFE)


def everything(memory: MemoryFabric) -> list[tuple[OutcomeSums, list[str]]]:
    """What is told of every provider in every setting of the log."""
    found = [asked(memory, card(name), place) for name in PROVIDERS for place in ("", "dock")]
    return [(one.sums, [record.record_id for record in one.examples]) for one in found]


def anew(log: Log) -> list[tuple[OutcomeSums, list[str]]]:
    return everything(MemoryFabric(store=log.store, index=log.index))


@pytest.mark.ledger("R60", symbol="harness.memory.history:OutcomeHistory.of")
def test_what_is_held_from_dispatch_to_dispatch_is_what_the_log_says() -> None:
    log = Log()
    seen = set()

    def compare() -> None:
        held = everything(log.memory)
        assert held == anew(log)
        seen.add(str(held))

    rounds: tuple[tuple[Verdict, str], ...] = (("satisfied", "p1"), ("violated", "p1"), ("ambiguous", "p2"))
    for number, (word, provider) in enumerate(rounds * 2):
        mission_id = log.begin(f"msn_{number}")
        log.dispatched(mission_id, provider=provider)
        compare()
        log.judged(mission_id, word)
        compare()
        if word != "satisfied":
            log.looked_again(mission_id)
            log.judged(mission_id, "violated")
            compare()
    assert len(seen) > 4


def test_what_another_process_committed_counts_at_the_next_question() -> None:
    log = Log()
    log.went(log.begin("msn_a"), "violated")
    before = asked(log.memory)
    log.went(log.begin("msn_b"), "violated")
    after = asked(log.memory)
    assert (before.sums.weight, round(after.sums.weight, 3)) == (1.0, 1.966)
    assert (
        after.position
        == log.memory.outcomes(
            card("p1").provider_id, capability="navigate", place="dock", configuration=CONFIGURATION, limit=1
        )[0].provenance.position
    )


def test_a_success_that_a_person_disputes_counts_no_longer() -> None:
    log = Log()
    log.went(log.begin("msn_a"))
    log.went(log.begin("msn_b"))
    assert (len(asked(log.memory).examples), everything(log.memory)) == (2, anew(log))
    dispute_arrival(log, MissionId("msn_a"))
    assert [one.provenance.mission_id for one in asked(log.memory).examples] == ["msn_b"]
    assert everything(log.memory) == anew(log)


def test_another_version_of_the_provider_is_judged_by_its_own_outcomes() -> None:
    log = Log()
    log.went(log.begin("msn_a"), "violated")
    older, newer = card("p1"), card("p1", version="2")
    assert asked(log.memory, older).sums.weight == 1.0
    assert asked(log.memory, newer).sums == OutcomeSums()
    mission_id = log.begin("msn_b")
    log.dispatched(mission_id, provider_version="2")
    log.judged(mission_id)
    assert [one.provenance.mission_id for one in asked(log.memory, newer).examples] == ["msn_b"]
    assert asked(log.memory, older).examples == ()


def test_a_lost_index_is_built_again_before_it_answers_for_a_setting_that_is_not_held() -> None:
    log = Log()
    log.went(log.begin("msn_a"))
    before = everything(log.memory)
    log.index.clear()
    assert everything(log.memory) == before == anew(log)


@pytest.mark.ledger("R60", symbol="harness.contracts.memory:OutcomeSums.after")
def test_an_outcome_counts_half_after_a_half_life_and_silent_verdicts_do_not_count() -> None:
    sums = OutcomeSums().after("unsafe", 0.0, half_life=2.0)
    assert sums == OutcomeSums(failed=1.0, weight=1.0, judged=1, refuted=1)
    for verdict in ("ambiguous", "stale"):
        assert sums.after(verdict, 1.0, half_life=2.0) == sums
    later = sums.after("satisfied", 0.25, half_life=2.0).after("satisfied", 0.0, half_life=2.0)
    assert later.failed == pytest.approx(0.5 + 0.25 * 2**-0.5)
    assert later.weight == pytest.approx(1.0 + 2**-0.5 + 0.5)
    assert (later.judged, later.refuted) == (3, 1)
