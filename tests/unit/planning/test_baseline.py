"""H_0 as it ships, and YAML that is not what it should be."""

import pytest

from harness.baseline.load import baseline, site
from harness.contracts.configuration import Configuration, ContextRules
from harness.contracts.errors import ContractInvalid
from harness.contracts.places import Site
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import decode, digest, encode
from harness.workspace.contract_yaml import read_yaml
from tests.saying import raises_saying

RULES = """
c1_items: 24
c2_items: 12
c2_examples: 3
c3_items: 16
c4_items: 20
minimum_confidence: 0.5
pose_age_s: 1.0
image_age_s: 30.0
"""
BOMB = "a: &a [x, x, x, x]\nb: &b [*a, *a, *a, *a]\nc: &c [*b, *b, *b, *b]\nd: [*c, *c, *c, *c]\n"


def test_the_baseline_is_four_sections_and_its_id_is_its_digest() -> None:
    configuration = baseline()
    assert Configuration.__struct_fields__ == ("context_rules", "templates", "routing", "recovery")
    assert configuration.configuration_id == digest(configuration) == baseline().configuration_id
    assert decode(encode(configuration), Configuration) == configuration
    assert [template.name for template in configuration.templates] == ["circuit", "recording", "warehouse-inspection"]


def test_the_context_limits_are_those_of_the_decisions() -> None:
    rules = baseline().context_rules
    assert (rules.c1_items, rules.c2_items, rules.c2_examples, rules.c3_items, rules.c4_items) == (24, 12, 3, 16, 20)
    assert (rules.minimum_confidence, rules.pose_age_s, rules.image_age_s) == (0.5, 1.0, 30.0)


def test_every_node_that_can_recover_has_the_budgets_of_the_decisions() -> None:
    for template in baseline().templates:
        for node in template.nodes:
            given = tuple(node["recovery"].values())
            assert given == ((0,) * 6 if template.name == "recording" else (2, 2, 1, 2, 1, 4))


def test_the_site_has_both_anchors_and_a_route_each_way() -> None:
    assert isinstance(site(), Site)
    assert {place.place_id for place in site().places} >= {"anchor_a", "office_storage"}
    assert {(route.start, route.end) for route in site().routes} >= {
        ("anchor_a", "office_storage"), ("office_storage", "anchor_a"), ("anchor_a", "anchor_a"),
    }  # fmt: skip


def test_yaml_of_a_contract_value_becomes_that_value() -> None:
    assert read_yaml(RULES, ContextRules, where="here").c3_items == 16


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (BOMB, "Line 2 uses an alias"),
        ("[" * 60 + "]" * 60, "nested over 24 deep"),
        ("[" * 100_000, "nested over 24 deep"),
        ("x" * 300_000, "has 300000 characters"),
        (RULES + "c1_items: 2\n", "the key 'c1_items' stands twice"),
        (RULES + "colour: blue\n", "unknown field `colour`"),
        (RULES.replace("pose_age_s: 1.0", "pose_age_s: 0"), r"Expected `float` > 0.*\$\.pose_age_s"),
        (RULES.replace("c1_items: 24", "c1_items: many"), r"Expected `int`, got `str`.*\$\.c1_items"),
        (RULES.replace("c1_items: 24\n", ""), "missing required field `c1_items`"),
        ("a: [1, 2", "It is not YAML as expected"),
        ("!!python/object/apply:os.getcwd []", "could not determine a constructor"),
        ("", "Expected `object`, got `null`"),
        ("a: 2026-99-99", "month must be in"),
        ("\x00", "It is not YAML as expected"),
    ],
)
def test_yaml_that_is_not_what_it_should_be_says_where_it_stands(text: str, says: str) -> None:
    with raises_saying(ContractInvalid, match=says) as error:
        read_yaml(text, ContextRules, where="a file")
    assert error.value.where.startswith("a file")
    assert len(str(error.value)) < 500


def test_a_template_is_not_read_as_something_else() -> None:
    with raises_saying(ContractInvalid, match=r"missing required field|unknown field"):
        read_yaml(RULES, TaskTemplate, where="a file")
