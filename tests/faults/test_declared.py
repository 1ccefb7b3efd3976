"""Effects that only their provider declares: never committed, never a precondition or a completion (D17, R108)."""

from collections.abc import Callable

import msgspec
import pytest
from msgspec import UNSET
from msgspec.structs import replace

from app.background.mission_history import Histories
from app.i18n.reasons.rendering import sentence
from app.views.mission_json import mission_outcome
from experiments.campaigns.kills import commits_of
from experiments.campaigns.ledgers import read_books
from harness.auditing.replay import replay_mission
from harness.bootstrap import simulated
from harness.contracts import events
from harness.contracts.contexts import Blobs, Context
from harness.contracts.decisions import Accepted
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import NodeId
from harness.contracts.ports import StoredEvent
from harness.contracts.protocol import InvocationReport
from harness.contracts.rules import CURRENT_RULES, RulesVersion
from harness.contracts.stored_commands import without_command
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import encode
from harness.contracts.verdicts import NodeVerdict
from harness.extra_templates import begin
from harness.projections.mission import declared_goals
from harness.projections.unverified import unverified_parts
from harness.provider_protocol.delegation import DelegatingProvider
from harness.runtime import Start
from harness.settings import HarnessSettings
from harness.verification.verdict import verify
from simulator.in_process import SIMULATOR
from tests.builders.connections import Stage, only, staged, template, with_node
from tests.builders.declared import DESCRIBE, DESCRIBED, FIRST, ORDER, SECOND, strict, two_pictures
from tests.builders.lies import Lie, emptied, lied_to
from tests.builders.missions_run import OPERATOR, ROBOT, Ran
from tests.builders.waiting import ADA, waiting
from tests.fakes.lying import Misspeaking
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


@pytest.mark.ledger("R108", symbol="harness.gate.rules:on_its_own_word")
@pytest.mark.ledger("R108", symbol="harness.contracts.rules:required_independence")
@pytest.mark.parametrize("risk", ["low", "medium", "high"])
def test_a_provider_s_word_alone_is_never_satisfied_whatever_the_risk(risk: str) -> None:
    base = two_pictures(declared=False)
    with strict() as stage:
        ran = stage.run(stage.begin(with_node(base, DESCRIBE, risk=risk)))
        assert "satisfied" not in ran.verdicts(DESCRIBE)
        assert not any(fact.node_id == DESCRIBE for fact in ran.mission.facts)
        assert ran.mission.status != "succeeded"


def test_a_verifier_that_calls_a_word_enough_is_overruled_by_the_gate() -> None:
    def generous(context: Context, blobs: Blobs) -> NodeVerdict:
        found = verify(context, blobs)
        results = tuple(
            replace(one, verdict="satisfied", required_independence=0, short=UNSET) for one in found.results
        )
        return replace(found, verdict="satisfied", results=results)

    with staged(verifier=generous, rules=2) as stage:
        ran = stage.run(stage.begin(two_pictures(declared=False)))
        assert "on_its_own_word" in ran.mission.of(DESCRIBE).rejections
        assert not any(fact.node_id == DESCRIBE for fact in ran.mission.facts)


class Silent(DelegatingProvider):
    """Says that it described the picture, and leaves no report of it."""

    def report(self, handle: str) -> InvocationReport:
        return replace(self.inner.report(handle), receipts=())


def test_consent_covers_a_word_and_nothing_less() -> None:
    with strict(only("describe_image", Silent)) as stage:
        ran = run(stage)
        assert not any(isinstance(event, events.EffectDeclared) for event in ran.events)
        assert ran.mission.status not in ("succeeded", "partly_verified")


def waiting_for_words() -> TaskTemplate:
    """The second picture waits for the description: a dependency that only a declared effect ends."""
    base = two_pictures()
    first, second, describe = base.nodes
    return replace(base, nodes=(first, describe, second | {"depends_on": [FIRST, DESCRIBE]}))


def test_a_declared_stage_ends_a_dependency_and_survives_a_restart() -> None:
    with waiting(rules=2) as made:
        start = Start(actor=ADA, robot_id=ROBOT, template="two-pictures", seed=3)
        assert isinstance(made.runtime.start(start, template=waiting_for_words()), Accepted)
        mission_id = made.runtime.missions()[0].mission_id
        while made.runtime.mission(mission_id).of(DESCRIBE).status != "declared":
            wake_s = made.supervisor.step(mission_id)
            assert wake_s is not None
            made.harness.clock.wait_until(wake_s)
        before = made.runtime.mission(mission_id)
        assert before.of(SECOND).status == "pending"
        made.restart()
        assert made.runtime.mission(mission_id) == before
        mission = made.supervisor.run(mission_id)
        assert mission.status == "partly_verified" and mission.of(SECOND).status == "committed"
        assert [effect.node_id for effect in mission.declared] == [DESCRIBE]
        assert replay_mission(made.runtime, mission_id).differences == ()


def test_a_declared_stage_gives_no_fact_to_a_condition_that_needs_one() -> None:
    """A stage whose condition reads the description's fact cannot be accepted on a declared one."""
    base = two_pictures()
    copy = dict(base.nodes[2]) | {
        "node_id": "again",
        "depends_on": [DESCRIBE],
        "evidence": {"mandatory": ["receipts"], "attestation": True},
    }
    copy["success_conditions"] = [
        {
            "condition_id": "again.of_description",
            "text": "It is about what was described",
            "effect": {
                "type": "relational",
                "predicate": "same_image",
                "relation": "same_image",
                "subject": "again",
                "object": DESCRIBE,
            },
        }
    ]
    with strict() as stage:
        ran = stage.run(stage.begin(replace(base, nodes=(*base.nodes, copy))))
        assert ran.mission.of(DESCRIBE).status == "declared"
        assert set(ran.verdicts("again")) == {"ambiguous"} and ran.mission.status == "awaiting_human"


def test_what_people_are_told_names_what_is_only_declared() -> None:
    base = two_pictures()
    told = {
        "node_id": "tell",
        "subgoal": "Say what was done",
        "capabilities": ["speak"],
        "depends_on": [DESCRIBE],
        "parameters": {"text_from": "Pictures that were described: @{describe.pictures}."},
        "resources": [],
        "evidence": {"mandatory": ["receipts"], "declared": ["tell.played"]},
        "timeout_s": 60.0,
        "required": False,
        "recovery": {"re_perceive": 0, "adjust_view": 0, "retry": 0, "local_replan": 0, "switch_skill": 0, "total": 0},
        "success_conditions": [
            {
                "condition_id": "tell.played",
                "text": "The words were played",
                "effect": {"type": "symbolic", "predicate": "played", "arguments": {}},
            }
        ],
    }
    speaking = replace(
        base, nodes=(*base.nodes, told), constraints=base.constraints | {"resources": ["camera", "speaker"]}
    )
    with strict() as stage:
        ran = stage.run(stage.begin(speaking))
        sent = [event for event in ran.events if isinstance(event, events.DispatchIntended) and event.node_id == "tell"]
        assert str(sent[0].parameters["text"]).endswith(
            "Declared, and unverified: The description is of the accepted picture."
        )
        assert ran.mission.status == "partly_verified"


def test_what_people_hear_names_the_stage_that_failed_too() -> None:
    """An optional stage that fails stops nothing, and the spoken report says that it was not done."""
    base = template("warehouse-inspection")
    hello = {
        "node_id": "hello",
        "subgoal": "Take a picture of the door",
        "capabilities": ["observe"],
        "depends_on": ["request"],
        "parameters": {"duration_s": 2.0, "frames": 1},
        "resources": [],
        "evidence": {"mandatory": ["image"]},
        "timeout_s": 30.0,
        "required": False,
        "recovery": {"re_perceive": 0, "adjust_view": 0, "retry": 0, "local_replan": 0, "switch_skill": 0, "total": 0},
        "success_conditions": [
            {
                "condition_id": "hello.pictured",
                "text": "One whole image of a size that no camera here has",
                "effect": {"type": "visual", "predicate": "pictured", "frames": 1, "width_px": 9999, "height_px": 9999},
            }
        ],
    }
    with staged() as stage:
        ran = stage.run(stage.begin(replace(base, nodes=(base.nodes[0], hello, *base.nodes[1:]))))
        assert ran.mission.of(NodeId("hello")).status == "failed"
        (said,) = [
            str(event.parameters["text"])
            for event in ran.events
            if isinstance(event, events.DispatchIntended) and event.node_id == "report"
        ]
        assert said.endswith("Failed, and unverified: Take a picture of the door.")
        (part,) = unverified_parts(ran.mission)
        assert (part.text, part.why, part.node_id) == ("Take a picture of the door", "failed", "hello")
        assert ran.mission.status == "succeeded", sentence(ran.mission.reason)
        heard = ran.mission.of(NodeId("report")).verdicts[-1].results[0]
        assert "failed and unverified" in sentence(heard.reason)


def called_verified(text: str) -> str:
    return text.replace("unverified", "verified")


def left_out(text: str) -> str:
    return text.partition(" Declared, and unverified")[0]


@pytest.mark.parametrize("say", [called_verified, left_out])
@pytest.mark.ledger("R108", symbol="harness.verification.spoken_report:unnamed")
def test_a_report_that_does_not_call_a_declared_part_unverified_is_not_accepted(say: Callable[[str], str]) -> None:
    with lied_to(Lie("speak", lambda one, blobs: Misspeaking(one, say)), rules=CURRENT_RULES) as stage:
        start = Start(actor=OPERATOR, robot_id=ROBOT, goal="Check the storage area and describe it", seed=3)
        assert isinstance(stage.runtime.start(start), Accepted)
        mission_id = stage.runtime.missions()[0].mission_id
        mission = stage.until(mission_id, lambda mission: bool(mission.of(NodeId("1.report")).verdicts))
        results = mission.of(NodeId("1.report")).verdicts[-1].results
        heard = next(one for one in results if "heard" in one.condition_id)
        assert heard.verdict == "ambiguous" and "unverified" in sentence(heard.reason)


def test_a_clear_passage_with_a_declared_part_is_heard_as_it_is() -> None:
    """What is said of declared parts must not sound like the contrary of the finding."""
    with lied_to(Lie(true_site=emptied(), seen=emptied()), rules=CURRENT_RULES) as stage:
        start = Start(actor=OPERATOR, robot_id=ROBOT, goal="Check the storage area and describe it", seed=3)
        assert isinstance(stage.runtime.start(start), Accepted)
        ran = stage.run(stage.runtime.missions()[0].mission_id)
        results = ran.mission.of(NodeId("1.report")).verdicts[-1].results
        heard = next(one for one in results if "heard" in one.condition_id)
        assert heard.verdict == "satisfied" and "declared and unverified" in sentence(heard.reason)
        assert ran.mission.status == "partly_verified", sentence(ran.mission.reason)
