"""Effects that only their provider declares: never committed, never a precondition or a completion (D17, R108)."""

import msgspec
import pytest
from msgspec.structs import replace

from app.background.mission_history import Histories
from app.i18n.reasons.rendering import sentence
from app.views.mission_json import mission_outcome
from experiments.campaigns.kills import commits_of
from experiments.campaigns.ledgers import read_books
from harness.auditing.replay import replay_mission
from harness.bootstrap import simulated
from harness.contracts import events
from harness.contracts.decisions import Accepted
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import CommittedFact
from harness.contracts.ports import StoredEvent
from harness.contracts.rules import RulesVersion
from harness.contracts.stored_commands import without_command
from harness.contracts.values import encode
from harness.extra_templates import begin
from harness.projections.mission import declared_goals
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.connections import Stage
from tests.builders.declared import DESCRIBE, DESCRIBED, FIRST, ORDER, SECOND, strict, two_pictures
from tests.builders.missions_run import OPERATOR, ROBOT, Ran
from tests.saying import raises_saying


def run(stage: Stage, **changes: object) -> Ran:
    return stage.run(stage.begin(two_pictures(**changes)))  # type: ignore[arg-type]


def test_a_declared_effect_ends_its_stage_without_a_fact_and_the_mission_in_part() -> None:
    with strict() as stage:
        ran = run(stage)
        mission = ran.mission
        assert mission.status == "partly_verified", sentence(mission.reason)
        assert [mission.of(name).status for name in (FIRST, SECOND, DESCRIBE)] == ["committed", "committed", "declared"]
        assert {fact.node_id for fact in mission.facts} == {FIRST, SECOND}
        assert [effect.condition_id for effect in mission.declared] == ["describe.of_picture"]
        kinds = [type(event) for event in ran.events]
        assert kinds.count(events.EffectDeclared) == kinds.count(events.PartialCompletionReported) == 1
        assert events.CompletionReported not in kinds and events.FailureReported not in kinds
        assert sentence(mission.report).startswith("Partly verified: ")
        assert "The description is of the accepted picture" in sentence(mission.report)
        assert replay_mission(stage.runtime, mission.mission_id).differences == ()


def test_without_consent_the_same_word_is_refused_and_a_person_is_asked() -> None:
    with strict() as stage:
        ran = run(stage, declared=False)
        assert ran.mission.of(DESCRIBE).status == "escalated" and ran.mission.status == "awaiting_human"
        assert not any(isinstance(event, events.EffectDeclared) for event in ran.events)
        assert set(ran.verdicts(DESCRIBE)) == {"ambiguous"}
        assert "independence 0, required 1" in sentence(ran.mission.of(DESCRIBE).verdicts[-1].reason)


def test_a_condition_that_rests_on_a_declared_stage_is_not_satisfied_and_is_named() -> None:
    with strict() as stage:
        ran = run(stage, goals=(ORDER, DESCRIBED))
        assert ran.mission.status == "partly_verified"
        assert [one.condition_id for one in declared_goals(ran.mission)] == ["goal.described"]
        verdict = ran.mission.goal_verdict
        assert verdict is not None
        results = {one.condition_id: one for one in verdict.results}
        assert results["goal.in_order"].verdict == "satisfied" and results["goal.in_order"].independence == 1
        assert results["goal.in_order"].rests_on == ("capture.pictured", "second.pictured")
        assert results["goal.described"].verdict == "ambiguous"
        assert "declared and not verified" in sentence(results["goal.described"].reason)


def test_an_order_that_holds_only_by_the_provider_s_word_is_named_too() -> None:
    order = ORDER | {"effect": ORDER["effect"] | {"nodes": [FIRST, DESCRIBE]}, "condition_id": "goal.all"}  # type: ignore[operator]
    with strict() as stage:
        ran = run(stage, goals=(ORDER, order))
        assert ran.mission.status == "partly_verified"
        assert ran.mission.goal_verdict is not None
        result = ran.mission.goal_verdict.results[1]
        assert (result.verdict, result.independence) == ("ambiguous", 0)
        assert result.rests_on == ("capture.pictured", "describe.of_picture")


def test_a_goal_of_which_nothing_would_be_verified_is_refused_before_anything_moves() -> None:
    with strict() as stage, raises_saying(ContractInvalid, match="nothing of the goal would be verified"):
        stage.begin(two_pictures(goals=(DESCRIBED,)))


def test_a_gate_that_commits_a_declared_effect_is_found_in_the_log() -> None:
    with strict() as stage:
        mission_id = run(stage).mission.mission_id
        log = stage.runtime.events(mission_id)
    assert read_books(log, commits_of(log)).unauthorised == []
    planted = [committing(one) if one.kind == "EffectDeclared" else one for one in log]
    found = read_books(planted, commits_of(planted)).unauthorised
    assert f"commit of {DESCRIBE}: the verdict is ambiguous" in found
    assert f"commit of {DESCRIBE}: a condition rests on too few sources" in found


def test_a_gate_that_calls_it_a_success_is_found_in_the_log() -> None:
    with strict() as stage:
        mission_id = run(stage).mission.mission_id
        log = stage.runtime.events(mission_id)
    planted = [succeeding(one) if one.kind == "MissionEnded" else one for one in log]
    assert f"success with {DESCRIBE} declared" in read_books(planted, commits_of(planted)).unauthorised


def committing(stored: StoredEvent) -> StoredEvent:
    """The same end as a broken gate would record it: a commit with the effects as its facts."""
    said = msgspec.json.decode(without_command(stored.body), type=events.EffectDeclared)
    (effect,) = said.effects
    fact = CommittedFact(
        name=effect.name,
        kind="event",
        node_id=effect.node_id,
        condition_id=effect.condition_id,
        packet_id=effect.packet_id,
        k=3,
        at_s=effect.at_s,
        arguments=effect.arguments,
        measured=effect.measured,
        independence=0,
    )
    committed = events.NodeCommitted(
        node_id=said.node_id, invocation_id=said.invocation_id, packet_id=said.packet_id, facts=(fact,)
    )
    return replace(stored, kind="NodeCommitted", body=encode(committed))


def succeeding(stored: StoredEvent) -> StoredEvent:
    ended = msgspec.json.decode(without_command(stored.body), type=events.MissionEnded)
    return replace(stored, body=encode(replace(ended, status="succeeded")))


@pytest.mark.parametrize(("rules", "status"), [(1, "succeeded"), (2, "partly_verified")])
def test_the_camera_task_ends_in_part_under_the_rules_that_want_another_source(
    rules: RulesVersion, status: str
) -> None:
    settings = HarnessSettings(speed=0, fidelity="kinematic")
    with simulated(settings, simulator=SIMULATOR, seed=3, rules=rules) as harness:
        asked = Start(actor=OPERATOR, robot_id=ROBOT, template="camera-report", seed=3)
        assert isinstance(begin(harness.runtime, asked), Accepted)
        mission = harness.supervisor.run(harness.runtime.missions()[0].mission_id)
        assert (mission.rules, mission.status) == (rules, status), sentence(mission.reason)
        levels = {fact.node_id: fact.independence for fact in mission.facts}
        assert levels == ({"capture": 1, "persist": 1} if rules == 2 else dict.fromkeys(mission.nodes))
        outcome = mission_outcome(mission, Histories(harness.runtime).of(mission.mission_id), ())
        declared = [one["condition_id"] for one in outcome["declared_conditions"]]
        assert declared == (["describe.of_picture", "goal.in_order"] if rules == 2 else [])
        others = [one for one in outcome["goal_conditions"] if one["condition_id"] not in declared]
        assert others and all(one["verdict"] == "satisfied" and one["independence"] >= rules - 1 for one in others)
        assert replay_mission(harness.runtime, mission.mission_id).differences == ()
