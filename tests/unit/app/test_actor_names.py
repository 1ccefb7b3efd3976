"""Who acted, and why, stands in words of people, also where a rule or a program acted."""

import pytest

from app.views.actors import is_rule, signed_reason
from app.web.filters import acting
from harness.contracts.actors import Actor
from harness.contracts.reasons import because
from rsi_reviews.rollback import DESK


def test_a_rule_of_the_harness_is_named_in_words_and_a_person_by_the_name_that_was_given() -> None:
    assert acting(DESK) == "the release rules" and is_rule(DESK)
    ada = Actor(name="ada", role="reviewer")
    assert acting(ada) == "ada" and not is_rule(ada)


@pytest.mark.parametrize(
    ("stored", "shown"),
    [
        ("evaluate: begin", "The evaluation was started."),
        ("evaluate: results", "Every case was run; these are the results."),
        ("because it waits less", "because it waits less"),
    ],
)
def test_the_words_of_a_program_that_signs_are_shown_as_a_sentence(stored: str, shown: str) -> None:
    assert signed_reason(stored) == shown


def test_a_reason_with_a_code_is_left_to_its_sentence() -> None:
    why = because("cancelled_by", actor="ada")
    assert signed_reason(why) is why
