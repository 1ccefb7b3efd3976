"""Which template a goal in words asks for."""

import pytest
from msgspec.structs import replace

from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import sha256
from harness.planning.templates import by_name, goal_of, select
from tests.unit.planning.building import CONFIGURATION, GOAL, template

TEMPLATES = CONFIGURATION.templates


@pytest.mark.parametrize(
    ("goal", "name"),
    [
        (GOAL, "warehouse-inspection"),
        ("please CHECK the office-storage area!", "warehouse-inspection"),
        ("Walk the circuit and come back", "circuit"),
    ],
)
def test_a_goal_selects_the_template_whose_phrase_it_holds(goal: str, name: str) -> None:
    assert select(goal, TEMPLATES).name == name


def test_every_template_is_found_by_its_own_goal_and_by_each_of_its_phrases() -> None:
    for one in TEMPLATES:
        for words in one.phrases:
            assert select(f"please {words} now", TEMPLATES) == one


def test_the_longest_phrase_wins_whatever_the_order_of_templates() -> None:
    vague = replace(template(), name="a-tour", phrases=("check the office",))
    for templates in ((vague, *TEMPLATES), (*TEMPLATES, vague)):
        assert select(GOAL, templates).name == "warehouse-inspection"


def test_a_tie_goes_to_the_name_that_comes_first() -> None:
    twin = replace(template(), name="a-twin")
    for templates in ((twin, template()), (template(), twin)):
        assert select(GOAL, templates).name == "a-twin"


def test_a_phrase_matches_whole_words_only() -> None:
    with pytest.raises(UnknownName):
        select("recheck the office storage areas", [replace(template(), phrases=("check the office storage area",))])


def test_a_goal_that_no_template_matches_is_told_what_can_be_asked() -> None:
    with pytest.raises(UnknownName, match="No template matches the goal 'make me a sandwich'") as error:
        select("make me a sandwich", TEMPLATES)
    assert GOAL in error.value.do
    assert "circuit" in error.value.do


@pytest.mark.parametrize("goal", ["", " \n\t", "x" * 10_000_000, "\ud800"])
def test_a_goal_that_is_empty_or_huge_or_no_text_is_a_typed_error(goal: str) -> None:
    with pytest.raises(ContractInvalid) as error:
        select(goal, TEMPLATES)
    assert error.value.where == "goal"
    assert len(str(error.value)) < 300


def test_the_goal_carries_the_checksum_of_its_own_bytes() -> None:
    assert goal_of("Grüße").digest == sha256("Grüße".encode())


def test_a_template_is_found_by_name_and_a_slip_is_answered_with_the_nearest() -> None:
    assert by_name("circuit", TEMPLATES).title == "Circuit"
    with pytest.raises(UnknownName, match="did you mean 'warehouse-inspection'"):
        by_name("warehouse-inspektion", TEMPLATES)
