"""Semantic memory: the capability contracts and rules that missions ran under."""

import pytest
from msgspec.structs import replace

from harness.contracts.ids import Digest
from harness.contracts.memory import KnownCard, KnownRules
from tests.builders.gate import CONFIGURATION, POLICY
from tests.unit.memory.building import Log
from tests.unit.planning.building import card


@pytest.mark.ledger("R140", symbol="harness.memory.semantic:semantic")
def test_capability_contracts_and_rules_are_kept_with_their_configuration() -> None:
    log = Log()
    log.shown(log.begin(), card("route-follower"))
    rules, shown = (one.record.knowledge for one in reversed(log.memory.semantic()))
    assert isinstance(rules, KnownRules) and isinstance(shown, KnownCard)
    assert (rules.configuration, rules.template, rules.recovery) == (CONFIGURATION, "test", POLICY)
    assert rules.constraints.speed_cap_mps == 0.5
    assert shown.card == card("route-follower")


def test_a_card_that_changed_supersedes_the_one_before_and_an_unchanged_one_adds_nothing() -> None:
    log = Log()
    log.shown(log.begin("msn_a"), card("route-follower"))
    log.shown(log.begin("msn_b"), card("route-follower"))
    log.shown(log.begin("msn_c"), replace(card("route-follower"), version="2"))
    cards = [one.record.knowledge for one in log.memory.semantic() if one.record.kind == "card"]
    assert [one.card.version for one in cards if isinstance(one, KnownCard)] == ["2"]
    assert [one.standing for one in log.found("card")] == ["superseded", "configured"]


def test_rules_of_two_configurations_stand_beside_each_other() -> None:
    log = Log()
    log.begin("msn_a")
    log.begin("msn_b", configuration=Digest("b" * 64))
    log.begin("msn_c", speed=0.3)
    assert [(one.record.knowledge.configuration[0], one.standing) for one in log.found("rules")] == [  # type: ignore[union-attr]
        ("c", "superseded"), ("b", "configured"), ("c", "configured"),
    ]  # fmt: skip


def test_a_dispatch_whose_context_was_not_stored_tells_nothing_of_its_card() -> None:
    log = Log()
    log.dispatched(log.begin())
    assert log.found("card") == []
