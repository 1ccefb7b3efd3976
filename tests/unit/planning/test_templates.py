"""The checksum of a goal text, and templates by their names."""

import pytest

from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import sha256
from harness.planning.templates import by_name, goal_of
from tests.saying import raises_saying
from tests.unit.planning.building import CONFIGURATION

TEMPLATES = CONFIGURATION.templates


@pytest.mark.parametrize("goal", ["", " \n\t", "x" * 10_000_000, "\ud800"])
def test_a_goal_that_is_empty_or_huge_or_no_text_is_a_typed_error(goal: str) -> None:
    with pytest.raises(ContractInvalid) as error:
        goal_of(goal)
    assert error.value.where == "goal"
    assert len(str(error.value)) < 300


def test_the_goal_carries_the_checksum_of_its_own_bytes() -> None:
    assert goal_of("Grüße").digest == sha256("Grüße".encode())


def test_a_template_is_found_by_name_and_a_slip_is_answered_with_the_nearest() -> None:
    assert by_name("circuit", TEMPLATES).title == "Circuit"
    with raises_saying(UnknownName, match="did you mean “warehouse-inspection”"):
        by_name("warehouse-inspektion", TEMPLATES)
