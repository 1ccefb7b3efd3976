"""What changes, as people read it: by component, in words with units, beside the raw text."""

import msgspec
import pytest

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from rsi_reviews.difference import difference
from tests.builders.releases import tried


@pytest.mark.ledger("R226", symbol="rsi_reviews.difference:difference")
def test_a_changed_ladder_is_shown_rung_by_rung_with_its_meaning() -> None:
    found = difference(baseline(), tried())
    (ladder, wait) = found.changes
    assert (ladder.before, ladder.after) == ("local_replan > switch_skill > human", "switch_skill > human")
    assert (wait.path, wait.before, wait.after, wait.unit) == ("recovery.wait_s", "20.0", "10.0", "s")
    assert ladder.meaning and wait.meaning
    assert found.of("recovery") == found.changes and found.of("routing") == ()


def test_a_change_in_a_template_names_its_stage_and_condition() -> None:
    tree = msgspec.json.decode(msgspec.json.encode(baseline()))
    circuit = next(template for template in tree["templates"] if template["name"] == "circuit")
    circuit["nodes"][1]["timeout_s"] = 90.0
    circuit["nodes"][1]["success_conditions"][0]["effect"]["tolerance_m"] = 0.3
    found = difference(baseline(), msgspec.convert(tree, Configuration))
    assert {(one.path, one.before, one.after, one.unit) for one in found.changes} == {
        ("templates.circuit.nodes.circuit.timeout_s", "180.0", "90.0", "s"),
        (
            "templates.circuit.nodes.circuit.success_conditions.circuit.closed.effect.tolerance_m",
            "0.4",
            "0.3",
            "as its kind",
        ),
    }


def test_another_order_of_stages_is_a_change_of_order_alone() -> None:
    tree = msgspec.json.decode(msgspec.json.encode(baseline()))
    tree["templates"].reverse()
    found = difference(baseline(), msgspec.convert(tree, Configuration))
    assert [one.path for one in found.changes] == ["templates (order)"]


def test_the_raw_difference_can_be_applied_line_by_line() -> None:
    lines = difference(baseline(), tried()).raw.splitlines()
    assert [line for line in lines if line.startswith("-") and not line.startswith("---")] == [
        '-        "local_replan",',
        '-    "wait_s": 20.0',
    ]
    assert '+    "wait_s": 10.0' in lines


def test_nothing_changed_is_an_empty_difference() -> None:
    found = difference(baseline(), baseline())
    assert (found.changes, found.raw) == ((), "")
