"""A reason becomes a sentence in the reader's language, hole by hole; what has no sentence is shown as it is."""

import pytest

from app.reasons import rendering
from harness.contracts.reasons import because, recorded

FAR = because("too_far_from_target", distance_m=7.491, bound_m=0.4)


def test_facts_fill_the_holes_of_the_message_in_each_language() -> None:
    assert rendering.sentence(FAR) == "7.49 m from the target, at most 0.40 m allowed"
    assert rendering.sentence(FAR, "zh-Hans") == "距目标 7.49 米，最多允许 0.40 米"


def test_what_an_older_release_said_stays_as_it_was_said() -> None:
    assert rendering.sentence(recorded("7 m {off}"), "zh-Hans") == "7 m {off}"


def test_reasons_within_a_reason_are_said_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendering, "SENTENCES", {**rendering.SENTENCES, "both": "{verdict:word}: {why}"})
    both = because("both", verdict="violated", why=(FAR, recorded("the lamp is off")))
    assert rendering.sentence(both).startswith("violated: 7.49 m from the target, at most 0.40 m allowed; the lamp")
    assert "；the lamp is off" in rendering.sentence(both, "zh-Hans")


def test_a_code_without_a_sentence_warns_and_is_shown_with_its_facts() -> None:
    with pytest.warns(UserWarning, match="no sentence"):
        assert rendering.sentence(because("of_tomorrow", limit_m=2.0)) == "of_tomorrow (limit_m 2.0)"
