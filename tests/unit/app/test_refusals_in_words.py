"""Each table of sentences has codes of its own, the gate's rules among them, and is told in every language."""

import pytest

from app.i18n.reasons import (
    alerts,
    console,
    contexts,
    execution,
    gate,
    outcomes,
    planning,
    proposals,
    recovery,
    rendering,
    restrictions,
    reviews,
    routing,
    supervision,
    verification,
)
from harness.contracts.reasons import because
from harness.gate.rules import GATE_RULES

TABLES = (alerts, console, contexts, execution, gate, outcomes, planning, proposals, recovery, restrictions,
          reviews, routing, supervision, verification)  # fmt: skip
EXAMPLES = (
    (because("too_few_people", quorum=2, reviewers=1, releasers=1), "2 approvals and a releaser", "需要 2 个批准"),
    (because("lease_held", resource="base", invocation_id="inv_1", mission_id="msn_1"), "base is held", "base"),
    (because("stage_missing", stages=("go", "look")), "go, look", "go、look"),
    (because("target_too_far", at="(1.00, 2.00)", way_m=9.04, longest_m=8.0), "9.0 m away", "9.0"),
    (because("robot_on_another_map", robot_map="b", way_map="a"), "on map b, the way on a", "b"),
    (because("ladder_end", limit=8), "within 8 steps", "8"),
    (because("no_supervisor_here"), "No supervisor runs here", "没有监督者"),
)


def test_no_two_tables_say_the_same_code() -> None:
    codes = [code for table in TABLES for code in table.SENTENCES]
    assert len(codes) == len(set(codes))


def test_every_rule_of_the_gate_has_a_sentence_of_its_name() -> None:
    assert [rule.__name__ for rule in GATE_RULES[2] if rule.__name__ not in gate.SENTENCES] == []


@pytest.mark.parametrize(("reason", "english", "chinese"), EXAMPLES)
def test_each_table_is_said_in_the_reader_s_language(reason: rendering.Reason, english: str, chinese: str) -> None:
    assert english in rendering.sentence(reason)
    assert chinese in rendering.sentence(reason, "zh-Hans")
