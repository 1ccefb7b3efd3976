"""Which goals start, as what, and which are asked about."""

import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline, shipped_workspace, site
from harness.contracts.effects import Relational
from harness.contracts.errors import ContractInvalid, GoalNotUnderstood, ReadingStale, UnknownName, Unsatisfiable
from harness.contracts.tasks import TaskContract
from harness.goals.understanding import GoalRequest, compiled, read_again, understand
from harness.planning.clauses import tells_only
from harness.planning.compile import Argument
from tests.saying import raises_saying

SITE = site()
TEMPLATES = (*baseline().templates, *shipped_workspace().missions)


def contract(text: str = "", *, template: str = "", confirm: str = "", **arguments: Argument) -> TaskContract:
    request = GoalRequest(template=template, text=text, arguments=arguments, confirm=confirm)
    found = understand(request, templates=TEMPLATES, site=SITE)
    return compiled(found, templates=TEMPLATES, site=SITE, arguments=arguments)


def stages(task: TaskContract) -> list[str]:
    return [node.node_id for node in task.nodes]


def asked(text: str, *, template: str = "") -> GoalNotUnderstood:
    with pytest.raises(GoalNotUnderstood) as error:
        contract(text, template=template)
    return error.value


def test_every_shipped_template_that_serves_clauses_is_understood_by_its_own_goal_and_by_its_name() -> None:
    for one in TEMPLATES:
        if one.serves and not tells_only(one):
            assert contract(one.goal).template == contract(template=one.name).template == one.name


def test_a_template_that_only_reports_has_nothing_to_say_by_itself() -> None:
    (one,) = [template for template in TEMPLATES if tells_only(template)]
    assert "no_template" in {unread.why for unread in asked(one.goal).question.unread}
    assert stages(contract("Walk the circuit and report")) == ["request", "1.circuit", "2.report"]


def test_a_goal_of_two_clauses_becomes_one_graph_with_one_return_at_the_end() -> None:
    task = contract("Walk the circuit and then check the storage area")
    assert stages(task) == [
        "request", "1.circuit", "2.go", "2.panorama", "2.analysis", "2.delivery", "2.return", "2.report",
    ]  # fmt: skip
    assert task.template == "circuit+warehouse-inspection"
    assert task.recovery_total == 8
    assert task.node("2.analysis").parameters["images_from"] == "@{2.panorama.frames}"  # type: ignore[arg-type]
    assert {one.clause for one in task.completion_conditions} == {"1", "2", "profile.return", "profile.report"}


def test_twice_is_done_twice_and_a_return_that_is_declined_is_left_out() -> None:
    task = contract("check the storage area twice and do not come back")
    assert [name for name in stages(task) if name.endswith((".analysis", ".return"))] == ["1.analysis", "2.analysis"]
    assert [one.clause for one in task.completion_conditions if one.condition_id == "goal.stayed"] == ["2"]
    assert "I am still at Office storage area." in str(task.node("1.report").parameters)  # type: ignore[arg-type]


def test_between_two_clauses_the_body_is_brought_to_where_the_second_begins() -> None:
    task = contract("Check the storage area and then walk the circuit")
    assert stages(task)[-3:] == ["2.go", "3.circuit", "1.report"]


def test_a_forbidden_region_is_a_constraint_and_a_condition_over_the_whole_mission() -> None:
    task = contract("Walk the circuit, but do not enter the corridor")
    assert task.constraints.keep_out == ("corridor",)
    (held,) = [one for one in task.completion_conditions if one.effect.predicate == "stayed_out"]
    assert held.clause == "2"


def test_a_region_that_the_only_way_crosses_is_refused_before_anything_moves() -> None:
    with raises_saying(Unsatisfiable, match="leads through corridor"):
        contract("Check the storage area, but stay out of the corridor")


@pytest.mark.parametrize(
    "text",
    [
        "Do not check the office storage area",
        "Go to the moon and paint it blue",
        "Go to the storage area but do not go to the storage area",
        "Walk the circuit and do not walk the circuit",
        "Wait at the dock",
        "Check the storage area 50 times",
        "Walk the circuit and do not come back",
    ],
)
def test_what_no_stage_or_constraint_expresses_does_not_start(text: str) -> None:
    assert asked(text).question.text == text


def test_a_goal_of_negations_alone_has_nothing_to_confirm() -> None:
    assert asked("Do not check the office storage area").question.nearest is None


def test_a_chosen_template_does_not_make_unread_words_its_goal() -> None:
    question = asked("Go to the moon and paint it blue", template="warehouse-inspection").question
    assert question.nearest is not None
    assert [clause.act for clause in question.nearest.clauses] == ["inspect"]
    assert question.unread


def test_a_template_that_does_another_thing_than_the_text_is_asked_about() -> None:
    assert asked("Walk the circuit", template="warehouse-inspection").question.template == "warehouse-inspection"


def test_a_confirmed_reading_starts_and_is_kept_with_what_stayed_unread() -> None:
    text = "Check the storage area if the door is open"
    nearest = asked(text).question.nearest
    assert nearest is not None
    task = contract(text, confirm=nearest.digest)
    assert task.confirmed == nearest.digest
    assert task.reading == nearest
    assert task.goal.text == text


@pytest.mark.parametrize("text", ["Check the storage area", "Check the storage area if the door is open", "Fly"])
def test_a_stale_digest_is_refused(text: str) -> None:
    with pytest.raises((ReadingStale, GoalNotUnderstood)) as error:
        contract(text, confirm="0" * 64)
    assert error.value.code == "reading_stale" or text == "Fly"


def test_an_argument_that_breaks_the_tie_with_the_text_is_refused() -> None:
    with raises_saying(ContractInvalid, match="The goal is about office_storage"):
        contract("Check the storage area", template="warehouse-inspection", destination="the dock")
    with raises_saying(UnknownName, match="No passage lies within anchor_a"):
        contract(template="warehouse-inspection", destination="the dock")
    with raises_saying(ContractInvalid, match="takes no parameter"):
        contract("Check the storage area", speed="9")


def test_the_same_reading_compiles_again_under_the_same_templates_to_the_same_contract() -> None:
    for text in ("Check the storage area", "Walk the circuit twice and then check the storage area"):
        task = contract(text)
        assert read_again(task, templates=TEMPLATES, site=SITE) == task


def test_a_reading_that_the_templates_no_longer_serve_is_not_compiled_to_something_else() -> None:
    task = contract("Check the storage area")
    without = tuple(one for one in TEMPLATES if one.name != "warehouse-inspection")
    with pytest.raises(ReadingStale):
        read_again(task, templates=without, site=SITE)


def test_a_condition_that_no_stage_can_show_to_hold_is_named() -> None:
    (whole,) = (one for one in TEMPLATES if one.name == "go-to-place")
    told = {"type": "symbolic", "predicate": "heard", "arguments": {"report": "go"}}
    condition = {"condition_id": "goal.told", "text": "It was told", "effect": told}
    extra = replace(whole, completion_conditions=(*whole.completion_conditions, condition))
    found = understand(GoalRequest(template=extra.name), templates=(extra,), site=SITE)
    with raises_saying(Unsatisfiable, match=r"goal\.told needs: analyse_passage, speak"):
        compiled(found, templates=(extra,), site=SITE, arguments={})


@pytest.mark.parametrize(
    "text",
    ["Check the storage area and describe it", "Photograph the storage area twice", "检查储物区，再去储物区拍照"],
)
def test_what_is_done_where_the_body_already_is_names_only_stages_that_there_are(text: str) -> None:
    task = contract(text)
    kept = set(stages(task))
    for condition in task.completion_conditions:
        if isinstance(condition.effect, Relational):
            assert condition.effect.subject in {*kept, "body"}, condition.condition_id
