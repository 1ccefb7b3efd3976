"""A mission and the configuration it is pinned to: kept to the end, compiled again only before it begins (D35)."""

import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from app.cli.main import app
from app.i18n.reasons.rendering import sentence
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.log_address import open_log
from harness.auditing.replay import replay_mission
from harness.baseline.load import baseline
from harness.bootstrap import simulated
from harness.contracts.commands import CreateMission, PauseMission, ResumeMission, StopMission
from harness.contracts.contexts import Context
from harness.contracts.decisions import Refused
from harness.contracts.errors import ConfigurationMissing
from harness.contracts.events import ContractRecompiled, DispatchIntended
from harness.contracts.ids import Digest, MissionId, NodeId, mission_stream
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission, required_policy
from harness.routing.question import RoutingQuestion
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.builders.connections import Stage, staged
from tests.builders.gate import POLICY, contract
from tests.builders.missions_run import OPERATOR, ROBOT, begin
from tests.builders.pointers import DECIDERS, POINTER, RELEASER, Point, release, select, sterner
from tests.builders.tampering import DoctoredStore
from tests.saying import raises_saying

H_0 = baseline().configuration_id


@pytest.fixture
def stage() -> Iterator[Stage]:
    with staged(deciders=DECIDERS, select=select) as stage:
        yield stage


def begun(mission: Mission) -> bool:
    return mission.status == "active" and mission.invocation is not None


def intents(stage: Stage, mission_id: MissionId) -> list[DispatchIntended]:
    told = [DECIDER.codec.decode(event) for event in stage.runtime.events(mission_id)]
    return [event for event in told if isinstance(event, DispatchIntended)]


def routed_under(stage: Stage, mission_id: MissionId) -> set[float]:
    """The history weights by which the mission's invocations were routed."""
    asked = [one.question for one in intents(stage, mission_id) if one.question is not None]
    assert asked
    return {decode(stage.runtime.record(name).body, RoutingQuestion).preferences.history for name in asked}


def judged_under(stage: Stage, mission: Mission) -> float:
    """How old a pose may be in the context that the goal was judged from, seconds."""
    assert mission.goal_verdict is not None
    shown = decode(stage.runtime.record(mission.goal_verdict.context).body, Context)
    policy = shown.one("policy")
    assert policy is not None
    age_s: float = policy.content["evidence"]["pose_age_s"]
    return age_s


@pytest.mark.ledger("R163", symbol="harness.runtime:Runtime.configuration_of")
def test_a_running_mission_keeps_the_configuration_it_began_with(stage: Stage) -> None:
    first = stage.begin("circuit")
    stage.until(first, begun, steps=500)
    newer = release(stage.runtime, sterner())
    ran = stage.run(first).mission
    assert (ran.status, ran.configuration) == ("succeeded", H_0)
    assert routed_under(stage, first) == {baseline().routing.history}
    assert judged_under(stage, ran) == 1.0
    assert {packet.configuration for node in ran.nodes.values() for packet in node.packets} == {H_0}

    second = stage.begin("circuit")
    after = stage.run(second).mission
    assert (after.status, after.configuration) == ("succeeded", newer)
    assert routed_under(stage, second) == {0.9}
    assert judged_under(stage, after) == 0.9
    assert required_policy(after).wait_s == 33.0
    assert replay_mission(stage.runtime, second).differences == ()


def test_a_pause_keeps_the_pin(stage: Stage) -> None:
    mission_id = stage.begin("circuit")
    stage.until(mission_id, begun, steps=500)
    stage.runtime.submit(mission_id, PauseMission(actor=OPERATOR, reason="a visitor"))
    stage.until(mission_id, lambda mission: mission.invocation is None)
    release(stage.runtime, sterner())
    stage.runtime.submit(mission_id, ResumeMission(actor=OPERATOR, reason="the visitor left"))
    ran = stage.run(mission_id).mission
    assert ran.configuration == H_0
    assert routed_under(stage, mission_id) == {baseline().routing.history}


@pytest.mark.ledger("R163", symbol="harness.supervisor.pinned_configurations:begin")
def test_what_was_compiled_before_a_release_is_compiled_again_when_it_begins(stage: Stage) -> None:
    mission_id = stage.begin("circuit")
    asked = stage.runtime.mission(mission_id)
    newer = release(stage.runtime, sterner())
    stage.until(mission_id, begun, steps=500)
    ran = stage.run(mission_id).mission
    again = [event for event in map(DECIDER.codec.decode, stage.runtime.events(mission_id))
             if isinstance(event, ContractRecompiled)]  # fmt: skip
    assert [(event.replaces, event.configuration) for event in again] == [(H_0, newer)]
    assert (ran.status, ran.configuration, required_policy(ran).wait_s) == ("succeeded", newer, 33.0)
    assert ran.contract == asked.contract
    assert intents(stage, mission_id)[0].k_ctx == 1
    assert routed_under(stage, mission_id) == {0.9}
    assert replay_mission(stage.runtime, mission_id).differences == ()


def test_a_goal_the_new_version_cannot_serve_ends_before_anything_moves(stage: Stage) -> None:
    mission_id = stage.begin("circuit")
    others = tuple(template for template in baseline().templates if template.name != "circuit")
    release(stage.runtime, replace(baseline(), templates=others))
    ran = stage.run(mission_id).mission
    assert (ran.status, ran.configuration) == ("failed", H_0)
    assert "cannot be compiled under the configuration" in sentence(ran.reason)
    assert stage.harness.starts(mission_id) == ()


def test_a_pointer_that_goes_back_pins_new_missions_to_the_same_bytes(stage: Stage) -> None:
    release(stage.runtime, sterner())
    release(stage.runtime, baseline())
    mission_id = stage.begin("circuit")
    assert stage.runtime.mission(mission_id).configuration == H_0
    assert stage.runtime.configuration_of(stage.runtime.mission(mission_id)) == baseline()


@pytest.mark.ledger("R163", symbol="harness.runtime:Runtime.pause_pinned")
def test_a_revoked_configuration_pauses_its_missions_for_a_person_and_swaps_none(stage: Stage) -> None:
    unsafe = release(stage.runtime, sterner())
    ended = stage.begin("circuit")
    stage.run(ended)
    running = stage.begin("circuit")
    stage.until(running, begun, steps=500)
    release(stage.runtime, baseline())
    assert stage.runtime.pause_pinned(unsafe, actor=RELEASER, reason="it moved too near") == (running,)
    paused = stage.until(running, lambda mission: mission.invocation is None)
    assert (paused.status, paused.configuration, paused.reason) == ("paused", unsafe, "it moved too near")
    assert stage.runtime.mission(ended).status == "succeeded"
    assert stage.supervisor.step(running) is None

    stage.runtime.submit(running, ResumeMission(actor=OPERATOR, reason="the way is free"))
    assert stage.run(running).mission.configuration == unsafe


def test_a_mission_on_the_current_configuration_is_not_paused_for_another(stage: Stage) -> None:
    unsafe = release(stage.runtime, sterner())
    release(stage.runtime, baseline())
    running = stage.begin("circuit")
    stage.until(running, begun, steps=500)
    assert stage.runtime.pause_pinned(unsafe, actor=RELEASER, reason="it moved too near") == ()
    assert stage.runtime.mission(running).status == "active"


@pytest.mark.ledger("R163", symbol="harness.supervisor.pinned_configurations:check_readable")
def test_a_mission_whose_configuration_cannot_be_read_is_listed_and_not_run(caplog: pytest.LogCaptureFixture) -> None:
    store, settings = DoctoredStore({}), HarnessSettings(speed=0, fidelity="kinematic")
    with simulated(settings, simulator=SIMULATOR, seed=3, store=store, configuration=sterner()) as harness:
        mission_id = begin(harness, "circuit")
    version = sterner().configuration_id
    store.doctored = {Digest(version): lambda body: body | {"fifth_section": {}}}
    with simulated(settings, simulator=SIMULATOR, seed=4, store=store, configuration=baseline()) as serving:
        serving.supervisor.serve()
    (told,) = [line for line in caplog.messages if line.startswith("not_run_here")]
    assert f"mission={mission_id}" in told
    with simulated(settings, simulator=SIMULATOR, seed=4, store=store, configuration=baseline()) as later:
        (unreadable,) = later.runtime.unreadable()
        assert (unreadable.mission_id, unreadable.configuration) == (mission_id, version)
        assert "fifth_section" in sentence(unreadable.reason)
        with raises_saying(ConfigurationMissing, match="cannot be read by this release"):
            later.supervisor.run(mission_id)
        assert later.supervisor.unfinished(ROBOT) == []
        assert later.runtime.mission(mission_id).status == "compiled"
        next_one = begin(later, "circuit", seed=5)
        assert later.supervisor.run(next_one).status == "succeeded"
        later.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="nobody can run it"))
        assert later.supervisor.run(mission_id).status == "cancelled"
        assert later.runtime.unreadable() == ()


def test_the_doctor_names_a_mission_whose_configuration_is_not_here(tmp_path: Path) -> None:
    known = CreateMission(
        mission_id=MissionId("msn_1"),
        robot_id=ROBOT,
        goal="Go and tell",
        template="test",
        requested_by=OPERATOR,
        configuration=Digest("0" * 64),
        contract=contract(),
        policy=POLICY,
    )
    with (
        closing(open_log(prepare(tmp_path).log_url)) as log,
        simulated(HarnessSettings(speed=0, fidelity="kinematic"), simulator=SIMULATOR, seed=3, store=log) as harness,
    ):
        harness.runtime.decide([(mission_stream(known.mission_id), known)])
    answer = CliRunner().invoke(app, ["doctor", "--data", str(tmp_path), "--json"])
    assert answer.exit_code == 1
    (problem,) = json.loads(answer.stdout)["problems"]
    assert "msn_1 is not run here" in problem
    assert "is not in this log" in problem


@pytest.mark.ledger("R155", symbol="harness.runtime:Runtime.pinned_to")
def test_a_version_has_the_missions_that_ran_under_it_with_their_evidence_failures_and_costs(stage: Stage) -> None:
    troubled = stage.run(stage.begin("circuit", "early-success")).mission
    newer = release(stage.runtime, sterner())
    other = stage.run(stage.begin("circuit")).mission
    assert list(stage.runtime.pinned_to(H_0)) == [troubled]
    assert list(stage.runtime.pinned_to(newer)) == [other]
    (told,) = stage.runtime.pinned_to(H_0)
    circuit = told.nodes[NodeId("circuit")]
    assert len(circuit.packets) > 1
    assert [failure.failure for failure in circuit.failures]
    assert (told.spent_total, other.spent_total) == (circuit.spent_total, 0)
    assert circuit.spent_total > 0


@pytest.mark.ledger("R155", symbol="harness.runtime:Runtime.start")
def test_the_version_is_stored_with_the_mission_that_is_pinned_to_it(stage: Stage) -> None:
    mission = stage.runtime.mission(stage.begin("circuit"))
    record = stage.runtime.record(mission.configuration)
    assert (record.kind, record.digest) == ("configuration", H_0)
    assert stage.runtime.verify().position > 0


def test_a_command_to_a_stream_of_another_family_is_decided_by_its_own_decider(stage: Stage) -> None:
    release(stage.runtime, sterner())
    before = stage.runtime.head()
    refused = stage.runtime.decide([(POINTER, Point(configuration=sterner().configuration_id))])
    assert isinstance(refused, Refused)
    assert refused.rule == "current"
    assert stage.runtime.head() == before
