"""A contract speaks the language of its reader where its template ships; a template of a site is shown as written."""

import pytest
from msgspec.structs import replace

from app.i18n.languages import localise
from app.i18n.task_texts import in_words, task_text
from harness.baseline.load import baseline, shipped_workspace, site
from harness.contracts.ids import NodeId
from harness.contracts.verdicts import ConditionResult
from harness.goals.understanding import GoalRequest, compiled, understand
from tests.unit.planning.building import contract

GO = NodeId("go")


def test_a_stage_that_names_a_place_is_said_in_the_readers_language_with_the_places_own_name() -> None:
    task = contract()
    place = task.bindings["destination"]["name"]
    said = task_text(task.node(GO).subgoal, task)
    assert said == task.node(GO).subgoal == f"Go to {place}"
    assert localise(said, "zh-Hans") == f"前往 {place}"


def test_the_text_of_a_judged_condition_is_said_too() -> None:
    task = contract()
    condition = task.node(GO).success_conditions[0]
    result = ConditionResult(
        condition_id=condition.condition_id, text=condition.text, verdict="satisfied", reason="measured"
    )
    assert localise(in_words((result,), task)[0].text, "zh-Hans").startswith("机身距")


def test_a_text_of_a_sites_own_template_is_shown_as_it_is_written() -> None:
    own = replace(contract(), template="night-watch")
    text = own.node(GO).subgoal
    assert localise(task_text(text, own), "zh-Hans") == text
    assert task_text("Water the plants", contract()) == "Water the plants"
    assert task_text(text, None) == text


@pytest.mark.parametrize(
    "goal",
    [
        "Walk the circuit and then check the storage area",
        "Walk the circuit, but stay out of the storage area",
        "Go to the storage area and do not come back",
    ],
)
def test_what_a_goal_of_several_clauses_adds_is_said_in_the_readers_language(goal: str) -> None:
    templates = (*baseline().templates, *shipped_workspace().missions)
    found = understand(GoalRequest(text=goal), templates=templates, site=site())
    task = compiled(found, templates=templates, site=site(), arguments={})
    said = {one.text: localise(task_text(one.text, task), "zh-Hans") for one in task.completion_conditions}
    assert [text for text, chinese in said.items() if text == chinese] == []


def test_a_place_that_is_named_like_a_message_of_the_console_keeps_its_name() -> None:
    task = contract()
    named = {**task.bindings, "destination": {**task.bindings["destination"], "name": "Office"}}
    said = task_text("Go to Office", replace(task, bindings=named))
    assert localise(said, "zh-Hans") == "前往 Office"
