"""The published goal set: its frozen part is as it was committed, and nothing starts that was not asked for."""

import hashlib

from experiments.goals.run import FOLDER, FROZEN, MOST_REFUSED, goals, outcome, refused_share

LINES = (FOLDER / "goals.jsonl").read_text(encoding="utf-8")
LATER = 403
"""Goals that were added after the set was published, by people who knew the grammar: all of them are read as wanted."""


def test_the_frozen_part_is_as_it_was_committed() -> None:
    body = "".join(LINES.splitlines(keepends=True)[:FROZEN]).encode()
    assert hashlib.sha256(body).hexdigest() == (FOLDER / "frozen.sha256").read_text(encoding="utf-8").split()[0]


def test_no_goal_starts_as_something_else_and_few_are_asked_about_needlessly() -> None:
    outcomes = [outcome(goal) for goal in goals(LINES)]
    assert [(one.goal["id"], one.read) for one in outcomes if one.answer == "wrong start"] == []
    frozen = outcomes[:FROZEN]
    assert refused_share(frozen) <= MOST_REFUSED and refused_share(outcomes[FROZEN:]) <= MOST_REFUSED
    later = {one.goal["text"]: one.answer for one in outcomes[LATER:]}
    assert {text: answer for text, answer in later.items() if not answer.startswith("right")} == {}
