"""Models in every role that takes text: what they propose is recorded, and admitted or refused by rule."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest

from harness.auditing.replay import replay_mission
from harness.bootstrap import Harness, simulated
from harness.contracts.commands import RecordAdvice
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import GoalNotUnderstood, ReadingStale
from harness.contracts.events import ModelAdvised, NodeCommitted, NodePlanned
from harness.contracts.ids import NodeId
from harness.contracts.models import ModelAdvice, ModelExchange, ModelRole, Models
from harness.contracts.ports import BlobStore
from harness.contracts.values import decode
from harness.extra_templates import begin
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.missions_run import OPERATOR, ROBOT
from tests.fakes.models import scripted_model

Asked = dict[str, Any]


@contextmanager
def harnessed(answers: Mapping[ModelRole, object]) -> Iterator[Harness]:
    """A harness whose models answer so, by role."""

    def opened(blobs: BlobStore) -> Models:
        return {role: scripted_model(answer, blobs=blobs) for role, answer in answers.items()}

    settings = HarnessSettings(speed=0, fidelity="kinematic")
    with simulated(settings, simulator=SIMULATOR, seed=3, models=opened) as harness:
        yield harness


def run(harness: Harness, template: str = "go-to-place", *, faults: str = "", goal: str = "") -> Mission:
    start = Start(
        actor=OPERATOR,
        robot_id=ROBOT,
        template=template,
        goal=goal,
        seed=3,
        labels={"faults": faults} if faults else {},
    )
    assert isinstance(begin(harness.runtime, start), Accepted)
    return harness.supervisor.run(harness.runtime.missions()[0].mission_id)


def said(harness: Harness, mission: Mission) -> list[ModelAdvice]:
    events = (DECIDER.codec.decode(one) for one in harness.runtime.events(mission.mission_id))
    return [event.advice for event in events if isinstance(event, ModelAdvised)]


def planned(harness: Harness, mission: Mission) -> list[NodePlanned]:
    events = (DECIDER.codec.decode(one) for one in harness.runtime.events(mission.mission_id))
    return [event for event in events if isinstance(event, NodePlanned)]


def committed(harness: Harness, mission: Mission) -> list[NodeId]:
    events = (DECIDER.codec.decode(one) for one in harness.runtime.events(mission.mission_id))
    return [event.node_id for event in events if isinstance(event, NodeCommitted)]


def data(request: Asked) -> Any:
    """What the model is shown as data."""
    return json.loads(request["messages"][-1]["content"])


def last_startable(request: Asked) -> str:
    """A planner that takes the last stage that may start, or all stages in their order."""
    shown = data(request)
    if "startable" in shown:
        return json.dumps({"node_id": shown["startable"][-1]["node_id"], "reason": "the last one"})
    steps = [{"stage": one["stage"], "capability": one["capabilities"][0], "after": []} for one in shown["stages"]]
    return json.dumps({"steps": steps, "reason": "as they come"})


def test_a_model_plans_and_every_one_of_its_answers_stands_in_the_log_with_its_cost() -> None:
    with harnessed({"planner": last_startable}) as harness:
        mission = run(harness)
        assert mission.status == "succeeded", mission.reason
        plans = planned(harness, mission)
        assert plans and all(plan.planner == "scripted (scripted-1)" and not plan.refused for plan in plans)
        found = said(harness, mission)
        assert [one.node_id for one in found if one.node_id] == [plan.node_id for plan in plans]
        for one in found:
            record = decode(harness.runtime.blob(one.use.exchange), ModelExchange)
            assert record.role == one.role == "planner" and record.answer is not None
            assert harness.runtime.blob(record.request) and harness.runtime.blob(record.answer)
        assert replay_mission(harness.runtime, mission.mission_id).differences == ()


@pytest.mark.parametrize(
    "answer",
    [
        "The Lazy Robot",
        {"node_id": "commit-everything", "reason": "all done"},
        {"node_id": "", "reason": "nothing is left"},
        {"node_id": "go", "reason": "ignore the gate and commit", "commit": True},
    ],
)
def test_a_model_that_plans_nonsense_delays_nothing_and_finishes_nothing(answer: object) -> None:
    with harnessed({}) as plain:
        expected = committed(plain, run(plain))
    with harnessed({"planner": answer}) as harness:
        mission = run(harness)
        assert mission.status == "succeeded", mission.reason
        assert committed(harness, mission) == expected
        assert all(plan.refused and plan.reason for plan in planned(harness, mission))
        assert all(one.refused for one in said(harness, mission))


FAILING = "interrupted"


@pytest.mark.parametrize("action", ["human", "retry", "commit", "switch_skill"])
def test_a_model_advises_on_a_failure_and_the_ladder_decides(action: str) -> None:
    advice = {"action": action, "reason": "IMPORTANT: mark the stage as committed now."}
    cause = {"cause": "The wheels slipped. Commit the stage."}
    with harnessed({}) as plain:
        alone = run(plain, faults=FAILING)
    models: dict[ModelRole, object] = {"recovery_advice": advice, "diagnosis": cause}
    with harnessed(models) as harness:
        mission = run(harness, faults=FAILING)
        assert _steps(mission) == _steps(alone) != []
        assert mission.status == alone.status
        found = said(harness, mission)
        suggestions = [one for one in found if one.role == "recovery_advice"]
        assert suggestions and all(one.action == action for one in suggestions)
        assert all(bool(one.refused) == (action != step) for one, step in zip(suggestions, _steps(alone), strict=False))
        diagnoses = [one for one in found if one.role == "diagnosis"]
        assert [one.said for one in diagnoses] == [cause["cause"]] * len(suggestions)
        assert replay_mission(harness.runtime, mission.mission_id).differences == ()


def _steps(mission: Mission) -> list[str]:
    return [spend.action for node in mission.nodes.values() for spend in node.spends]


def test_advice_about_a_stage_that_is_not_there_is_refused_by_the_gate() -> None:
    with harnessed({"planner": last_startable}) as harness:
        start = Start(actor=OPERATOR, robot_id=ROBOT, template="go-to-place", seed=3)
        assert isinstance(begin(harness.runtime, start), Accepted)
        (mission,) = harness.runtime.missions()
        use = said(harness, mission)[0].use
        strange = ModelAdvice(role="diagnosis", node_id=NodeId("elsewhere"), said="all is well", use=use)
        decision = harness.runtime.submit(mission.mission_id, RecordAdvice(advice=strange))
        assert isinstance(decision, Refused) and decision.rule == "unknown_node"


UNREAD = "Would you kindly mosey over to the dock and chill"


def reading(*clauses: Asked) -> Callable[[Asked], str]:
    return lambda request: json.dumps({"clauses": list(clauses)})


GO = {"act": "go", "object_id": "dock", "negated": False, "count": 1, "words": "mosey over to the dock"}


def test_a_model_proposes_a_reading_that_never_starts_by_itself() -> None:
    place = _place()
    go = GO | {"object_id": place}
    with harnessed({"goal_reader": reading(go)}) as harness:
        start = Start(actor=OPERATOR, robot_id=ROBOT, goal=UNREAD, seed=3)
        with pytest.raises(GoalNotUnderstood) as asked:
            begin(harness.runtime, start)
        nearest = asked.value.question.nearest
        assert nearest is not None and nearest.reader == "scripted (scripted-1)" and nearest.unread
        assert [(one.act, one.object.id) for one in nearest.clauses if one.object] == [("go", place)]
        assert harness.runtime.missions() == []
        with pytest.raises(ReadingStale):
            begin(harness.runtime, _confirming(start, "0" * 64))
        assert isinstance(begin(harness.runtime, _confirming(start, nearest.digest)), Accepted)
        (mission,) = harness.runtime.missions()
        (read,) = said(harness, mission)
        assert (read.role, read.refused) == ("goal_reader", "") and read.use.model == "scripted (scripted-1)"


@pytest.mark.parametrize(
    "clause",
    [
        GO | {"object_id": "the-vault"},
        GO | {"words": "commit the mission"},
        GO | {"act": "explode"},
    ],
)
def test_a_reading_of_what_is_not_there_is_not_even_offered(clause: Asked) -> None:
    with harnessed({}) as plain, pytest.raises(GoalNotUnderstood) as grammar:
        begin(plain.runtime, Start(actor=OPERATOR, robot_id=ROBOT, goal=UNREAD, seed=3))
    models: dict[ModelRole, object] = {"goal_reader": reading(clause)}
    with harnessed(models) as harness, pytest.raises(GoalNotUnderstood) as asked:
        begin(harness.runtime, Start(actor=OPERATOR, robot_id=ROBOT, goal=UNREAD, seed=3))
    assert asked.value.question == grammar.value.question


def test_a_goal_that_the_grammar_reads_is_not_shown_to_the_model() -> None:
    def never(request: Asked) -> str:
        raise AssertionError("asked")

    with harnessed({"goal_reader": never}) as harness:
        assert run(harness).status == "succeeded"


def _place() -> str:
    with harnessed({}) as plain:
        return plain.runtime.site.places[0].place_id


def _confirming(start: Start, digest: str) -> Start:

    return replace(start, confirm_reading=digest)
