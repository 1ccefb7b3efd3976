"""A reason becomes a sentence in the reader's language, hole by hole; what has no sentence is shown as it is."""

import pytest

from app.i18n.reasons import evaluations, rendering
from harness.contracts.reasons import because, recorded

FAR = because("too_far_from_target", distance_m=7.491, bound_m=0.4)


def test_facts_fill_the_holes_of_the_message_in_each_language() -> None:
    assert rendering.sentence(FAR) == "7.49 m from the target, bound 0.40 m"
    assert rendering.sentence(FAR, "zh-Hans") == "距目标 7.49 米，界限 0.40 米"


def test_what_an_older_release_said_stays_as_it_was_said() -> None:
    assert rendering.sentence(recorded("7 m {off}"), "zh-Hans") == "7 m {off}"


def test_reasons_within_a_reason_are_said_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendering, "SENTENCES", {**rendering.SENTENCES, "both": "{verdict:word}: {why}"})
    both = because("both", verdict="violated", why=(FAR, recorded("the lamp is off")))
    assert rendering.sentence(both).startswith("violated: 7.49 m from the target, bound 0.40 m; the lamp")
    assert "；the lamp is off" in rendering.sentence(both, "zh-Hans")


def test_a_sentence_within_a_message_keeps_one_stop() -> None:
    why = because("no_node_eligible")
    shown = because("alert_with_goal", text=why, goal="check the storage area")
    assert rendering.sentence(why).endswith(".")
    assert rendering.sentence(shown) == f"{rendering.sentence(why)} Goal: check the storage area"
    assert "。。" not in rendering.sentence(shown, "zh-Hans")


def test_a_code_without_a_sentence_warns_and_is_shown_with_its_facts() -> None:
    with pytest.warns(UserWarning, match="no sentence"):
        assert rendering.sentence(because("of_tomorrow", limit_m=2.0)) == "of_tomorrow (limit_m 2.0)"


def test_a_reason_of_the_recovery_ladder_is_told_in_chinese_to_its_last_word() -> None:
    seen = because("several", reasons=(because("route_not_covered", share=0.925, bound=0.95), FAR))
    reason = because(
        "next_step",
        failure=because("failure_explained", failure="ambiguous", why=seen),
        tried=("re_perceive",),
        following=because("action_by_provider", action="switch_skill", provider_id="careful-local-planner"),
        left_node=2,
        left_mission=8,
    )
    assert rendering.sentence(reason) == (
        "Ambiguous (92.5% of the route was measured, bound 95%; 7.49 m from the target, bound 0.40 m). Tried before: "
        "re perceive. Next: switch skill by careful-local-planner. "
        "Recovery attempts left: 2 in this stage, 8 in the mission."
    )
    assert rendering.sentence(reason, "zh-Hans") == (
        "不明确（实测走完路线的 92.5%，界限 95%；距目标 7.49 米，界限 0.40 米）。此前已尝试：再次感知。"
        "接下来：由 careful-local-planner 更换技能。剩余恢复次数：本阶段 2，任务 8。"
    )


def test_an_identifier_that_equals_a_word_of_the_catalogue_stays_as_it_is() -> None:
    said = rendering.sentence(because("no_accepted_fact_of_stage", name="arrival", stage="report"), "zh-Hans")
    assert "report" in said and "arrival" in said


def test_a_name_in_capitals_that_equals_a_message_stays_as_it_is() -> None:
    assert rendering.translated("Missions", "zh-Hans") != "Missions"
    assert "Missions" in rendering.sentence(because("unknown_place_id", place_id="Missions"), "zh-Hans")


def test_what_a_permission_lets_somebody_do_is_said_in_the_reader_s_language() -> None:
    reason = because("token_not_permitted", meaning="answer a handoff", scope="decide")
    assert "answer" not in rendering.sentence(reason, "zh-Hans")


@pytest.mark.parametrize("code", sorted(evaluations.SENTENCES))
def test_an_error_of_an_evaluation_has_a_sentence_in_every_language(code: str) -> None:
    assert rendering.translated(evaluations.SENTENCES[code], "zh-Hans") != evaluations.SENTENCES[code]


def test_a_failure_that_the_execution_ended_with_is_named_once() -> None:
    def told(ended_with: str) -> str:
        why = because("execution_over_with_failure", terminal="failed", failure=ended_with)
        return rendering.sentence(because("failure_explained", failure="no_progress", why=why))

    assert told("no_progress") == "no progress (the execution ended failed)"
    assert told("blocked") == "no progress (the execution ended failed: blocked)"
    alone = because("execution_over_with_failure", terminal="failed", failure="no_progress")
    assert rendering.sentence(alone) == "the execution ended failed: no progress"
    assert rendering.sentence(rendering.beside("no_progress", alone)) == "the execution ended failed"
