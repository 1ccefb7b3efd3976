"""What the machinery said is told again sentence by sentence, hole by hole, and never half."""

import pytest

from app.i18n.retelling import Retelling

WORDS = {"ambiguous": "不明确", "navigate": "导航", "look again": "再看一次", "nothing": "没有"}
SENTENCES = {
    "{share} of the route was measured, bound {bound}": "实测 {share}，界限 {bound}",
    "sources disagree: they differ by {differ}": "来源不一致：相差 {differ}",
    "{failure} ({said})": "{failure}（{said}）",
    "{upper}{failure}. Tried: {tried}. Next: {following}.": "{upper}{failure}。试过：{tried}。接下来：{following}。",
    "{text}: {verdict}, {reason}": "{text}：{verdict}，{reason}",
    "offers {capability}, not {wanted}": "提供{capability}，不提供{wanted}",
    "a person is asked": "向人提问",
    "The robot stands": "机器人站着",
    "it is done": "已完成",
}


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("ambiguous", "不明确"),
        ("The robot stands.", "机器人站着。"),
        ("offers navigate, not look_again", "提供导航，不提供再看一次"),
        ("92% of the route was measured, bound 95%; it is done", "实测 92%，界限 95%；已完成"),
        ("circuit.closed: it is done", "circuit.closed：已完成"),
        ("it is done: look_again", "已完成：再看一次"),
        ("The robot stands. it is done.", "机器人站着。已完成。"),
        (
            "Ambiguous (92% of the route was measured, bound 95%; it is done). Tried: nothing, look again. "
            "Next: a person is asked.",
            "不明确（实测 92%，界限 95%；已完成）。试过：没有、再看一次。接下来：向人提问。",
        ),
        (
            "It came back: ambiguous, 92% of the route was measured, bound 95%; it is done",
            "It came back：不明确，实测 92%，界限 95%；已完成",
        ),
    ],
)
def test_a_sentence_of_the_machinery_is_told_with_everything_that_fills_it(said: str, told: str) -> None:
    assert Retelling(WORDS, SENTENCES).told(said) == told


@pytest.mark.parametrize(
    "said",
    [
        "it is not done",
        "it is done; and a person said more",
        "The robot stands. Nobody knows why.",
        "seen by a person: 92 of them",
        "look_again",
        "it is done " * 400,
    ],
)
def test_what_is_not_known_whole_stays_as_it_was_said(said: str) -> None:
    assert Retelling(WORDS, SENTENCES).told(said) == said


def test_a_sentence_that_lost_its_full_stop_is_known_all_the_same() -> None:
    known = Retelling(
        WORDS, {"Nobody can do {wanted}.": "无人能{wanted}。", "{either}. Goal: {goal}": "{either}。目标：{goal}"}
    )
    assert known.told("Nobody can do navigate. Goal: walk there") == "无人能导航。目标：walk there"
