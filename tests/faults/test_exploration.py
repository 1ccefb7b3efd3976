"""Exploring missions on the simulated robot: targets chosen one by one, what comes of them, and all of it replayed."""

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.auditing.legacy import guessed_command
from harness.auditing.replay import replay_mission
from harness.baseline.load import shipped_workspace
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.events import DispatchIntended, MissionEvent
from harness.contracts.exploration import (
    FREE,
    BlockedTarget,
    GridMap,
    MapChanged,
    Reached,
    TargetChoice,
    TargetProposal,
    TargetQuestion,
)
from harness.contracts.ids import Digest, MissionId, NodeId
from harness.contracts.reasons import Reason
from harness.contracts.revision_commands import ReviseContract
from harness.contracts.revision_events import GraphRevised
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import Moment, Point, decode, digest
from harness.exploration.grid import area_m2
from harness.exploration.paths import Ways
from harness.exploration.targets import NEAREST_EDGE, Proposer, nearest_edge, target_refusal
from harness.gate.decide import DECIDER, decide
from harness.planning.templates import by_name
from harness.projections.exploration import TARGETS, choices, decisions
from harness.projections.mission import Mission, required_contract
from tests.builders.connections import Stage, staged
from tests.builders.missions_run import Ran
from tests.builders.pointers import DECIDERS, release, select, sterner
from tests.builders.tampering import Body, rewritten

NOW = Moment(mission_s=1000.0, wall_s=2000.0)


def exploration() -> TaskTemplate:
    return by_name("exploration", shipped_workspace().missions)


class Explored:
    """One exploring mission that is over, and what it was shown before each choice."""

    def __init__(self, stage: Stage, *faults: str) -> None:
        self.stage = stage
        self.ran: Ran = stage.run(stage.begin(exploration(), *faults))
        self.mission = self.ran.mission

    @property
    def questions(self) -> list[TargetQuestion]:
        found = (self.stage.runtime.record(one.question).body for one in decisions(self.mission))
        return [decode(body, TargetQuestion) for body in found]

    def grid(self, name: Digest) -> GridMap:
        return decode(self.stage.runtime.blob(name), GridMap)

    def before(self, revision: int) -> tuple[Mission, ReviseContract]:
        """The mission as it was when a revision was asked for, and the command that asked."""
        events: list[MissionEvent] = self.ran.events
        places = [index for index, event in enumerate(events) if isinstance(event, GraphRevised)]
        command = guessed_command(events[places[revision] :])
        assert isinstance(command, ReviseContract)
        return DECIDER.fold(DECIDER.initial, events[: places[revision]]), command


@pytest.fixture(scope="module")
def blocked() -> Iterator[Explored]:
    """Boxes from wall to wall close the way to the first target, and stay."""
    with staged() as stage:
        yield Explored(stage, "blocked-passage:persistent")


@pytest.fixture(scope="module")
def free() -> Iterator[Explored]:
    with staged() as stage:
        yield Explored(stage)


def test_an_exploration_reaches_its_targets_and_the_goal_is_verified(free: Explored) -> None:
    mission = free.mission
    assert mission.status == "succeeded", mission.reason
    reached = [one for one in decisions(mission) if one.status == "committed"]
    assert len(reached) >= 2 and free.ran.false_completions() == [] and free.ran.duplicate_starts() == 0
    known = [area_m2(free.grid(name), kind=FREE) for one in reached for name in (one.map_before, one.map_after) if name]
    assert known[-1] > known[0] + 10.0


@pytest.mark.ledger("R223", symbol="harness.projections.exploration:feedback")
def test_a_blocked_target_and_the_changed_map_return_to_the_next_choice(blocked: Explored) -> None:
    first, second, third = blocked.questions[:3]
    assert first.feedback == ()
    refused, changed = second.feedback
    leg = NodeId("leg-1")
    assert isinstance(refused, BlockedTarget) and (refused.node_id, refused.failure) == (leg, "no_progress")
    assert isinstance(changed, MapChanged) and changed.closed_m2 > 0
    assert (changed.before, changed.after) == (first.map, second.map)
    assert [type(one) for one in third.feedback] == [BlockedTarget, MapChanged, Reached, MapChanged]
    given_up, instead = (choice.target_m for choice in list(choices(required_contract(blocked.mission)).values())[:2])
    assert math.dist(given_up, instead) > 0.8
    assert blocked.mission.of(leg).status == "failed" and blocked.mission.status == "succeeded"


def test_without_its_feedback_the_proposer_would_go_where_it_was_given_up(blocked: Explored) -> None:
    second = blocked.questions[1]
    said = second.feedback[0]
    edge = replace(second.frontiers[0], approach_m=said.target_m, edge_m=said.target_m, length_m=50.0)
    tempted = replace(second, frontiers=(edge, *second.frontiers))
    ignorant = nearest_edge(replace(tempted, feedback=()))
    told = nearest_edge(tempted)
    assert ignorant is not None and ignorant.target_m == said.target_m
    assert told is not None and told.target_m != said.target_m


def test_goal_conditions_and_committed_history_stay_through_every_revision(blocked: Explored) -> None:
    contracts = [event.contract for event in blocked.ran.events if isinstance(event, GraphRevised)]
    assert len(contracts) == len(blocked.questions) >= 3
    kept = required_contract(blocked.mission)
    for revised in contracts:
        assert revised is not None
        assert (revised.goal, revised.completion_conditions) == (kept.goal, kept.completion_conditions)
        assert {node.node_id for node in revised.nodes} >= {NodeId("request"), NodeId("view"), NodeId("close")}
    spends = [spend.action for spend in blocked.mission.of(NodeId("close")).spends]
    assert spends == ["local_replan"] * len(contracts)


@pytest.mark.ledger("R224", symbol="harness.projections.exploration:decisions")
def test_each_decision_links_picture_target_response_and_map_under_one_mission(blocked: Explored) -> None:
    mission, runtime = blocked.mission, blocked.stage.runtime
    shown = decisions(mission)
    assert [one.leg for one in shown] == [f"leg-{number + 1}" for number in range(len(shown))]
    pictures = {image for fact in mission.facts if fact.name == "pictured" for image in fact.arguments["images"]}
    for one in shown:
        assert (one.mission_id, one.configuration) == (mission.mission_id, mission.configuration)
        assert one.image in pictures and runtime.blob(one.image).startswith(b"\xff\xd8")
        node = required_contract(mission).node(one.leg)
        assert node.parameters["target"] == one.target_m
        assert one.response is not None and one.map_after is not None
        assert {blocked.grid(one.map_before).map_version, blocked.grid(one.map_after).map_version} == {"site-1"}
    assert [one.response.terminal for one in shown if one.response][:2] == ["failed", "succeeded"]
    assert [one.map_before for one in shown[1:]] == [one.map_after for one in shown[:-1]]
    named = {name for event in runtime.events(mission.mission_id) for name in (event.body.decode(),)}
    assert all(any(one.image in body and one.question in body for body in named) for one in shown)


def test_replay_derives_every_target_and_every_map_again(blocked: Explored) -> None:
    report = replay_mission(rewritten(blocked.stage.parts), blocked.mission.mission_id)
    assert report.differences == ()
    assert (report.targets, report.maps) == (len(blocked.questions), len(blocked.questions) + 1)


def rebound(**changes: Any) -> Any:
    def change(body: Body) -> Body:
        targets = body["contract"]["bindings"][TARGETS]
        targets[max(targets)] |= changes
        return body

    return change


@pytest.mark.ledger("R224", symbol="harness.auditing.exploration:target_differences")
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (rebound(image="0" * 64), "the contract was bound to another choice than the one that was made"),
        (rebound(reason="It looked nice."), "the contract was bound to another choice than the one that was made"),
        (rebound(configuration="0" * 64), "wrong_configuration"),
    ],
)
def test_a_choice_that_was_changed_afterwards_is_named(blocked: Explored, change: Any, says: str) -> None:
    *_, stored = (one for one in blocked.stage.parts.store.read(0, 10_000) if one.kind == "GraphRevised")
    doctored = rewritten(blocked.stage.parts, events={stored.position: change})
    report = replay_mission(doctored, blocked.mission.mission_id)
    assert any(says in line for line in map(sentence, report.differences))
    assert all(f"position {stored.position}," in line for line in map(sentence, report.differences))


@pytest.mark.parametrize("name", ["question", "answer"])
def test_a_changed_record_of_a_choice_is_named(blocked: Explored, name: str) -> None:
    one = decisions(blocked.mission)[1]
    doctored = rewritten(blocked.stage.parts, records={getattr(one, name): lambda body: body | {"k": 99}})
    report = replay_mission(doctored, blocked.mission.mission_id)
    assert any("was changed" in line for line in map(sentence, report.differences))


def test_a_map_that_was_exchanged_is_named(blocked: Explored) -> None:
    positions = [one for one in blocked.stage.parts.store.read(0, 10_000) if one.kind == "ObservationRecorded"]
    other = msgspec.json.decode(positions[0].body)["reference"]["blob"]

    def exchanged(body: Body) -> Body:
        body["reference"]["blob"] = other
        return body

    doctored = rewritten(blocked.stage.parts, events={positions[1].position: exchanged})
    report = replay_mission(doctored, blocked.mission.mission_id)
    assert any("drawn again" in line for line in map(sentence, report.differences))


def bound(contract: TaskContract, **changes: Any) -> TaskContract:
    """The contract with its first target's choice changed."""
    targets = {name: dict(choice) for name, choice in contract.bindings[TARGETS].items()}
    targets["leg-1"] |= changes
    return replace(contract, bindings={**contract.bindings, TARGETS: targets})


def redirected(contract: TaskContract) -> TaskContract:
    nodes = tuple(
        replace(node, parameters={**node.parameters, "target": (3.0, 3.0)}) if node.node_id == "leg-1" else node
        for node in contract.nodes
    )
    return replace(contract, nodes=nodes)


@pytest.mark.ledger("R222", symbol="harness.planning.targets:choice_refusal")
@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda contract: bound(contract, mission_id="msn_another"), "foreign_target"),
        (lambda contract: bound(contract, configuration="0" * 64), "wrong_configuration"),
        (lambda contract: bound(contract, k=99), "obsolete_target"),
        (redirected, "another_target"),
        (lambda contract: replace(contract, bindings={}), "target_unbound"),
    ],
)
def test_the_gate_takes_a_target_only_for_this_mission_its_configuration_and_its_version(
    free: Explored, change: Any, rule: str
) -> None:
    mission, command = free.before(0)
    assert isinstance(decide(mission, command, NOW), Accepted)
    refused = decide(mission, replace(command, contract=change(command.contract)), NOW)
    assert isinstance(refused, Refused) and refused.rule == rule


def test_a_target_that_was_chosen_before_cannot_be_exchanged(free: Explored) -> None:
    mission, command = free.before(1)
    refused = decide(mission, replace(command, contract=bound(command.contract, reason="another one")), NOW)
    assert isinstance(refused, Refused) and refused.rule == "history_changed"


def test_every_leg_is_dispatched_to_its_target_under_the_pinned_configuration(free: Explored) -> None:
    chosen: dict[NodeId, TargetChoice] = choices(required_contract(free.mission))
    legs = [event for event in free.ran.events if isinstance(event, DispatchIntended) and event.node_id in chosen]
    assert {event.node_id for event in legs} == set(chosen)
    for event in legs:
        assert event.parameters["target"] == chosen[event.node_id].target_m
    for name in chosen:
        packets = free.mission.of(name).packets
        assert {packet.configuration for packet in packets} == {chosen[name].configuration}
        assert {packet.identity.mission_id for packet in packets} == {chosen[name].mission_id}


def test_a_mission_compiled_again_before_it_begins_binds_its_targets_to_the_newer_version() -> None:
    with staged(deciders=DECIDERS, select=select) as stage:
        mission_id = stage.begin(exploration())
        newer = release(stage.runtime, sterner())
        mission = stage.run(mission_id).mission
        assert (mission.status, mission.configuration) == ("succeeded", newer)
        assert {one.configuration for one in decisions(mission)} == {newer}


OUTSIDE: dict[str, Point] = {
    "outside_map": (900.0, 0.0),
    "outside_zones": (-2.2, -3.8),
    "unreachable": (12.0, 12.0),
}


@pytest.mark.parametrize("rule", OUTSIDE)
def test_an_inadmissible_proposal_is_refused_with_its_reason_and_the_harness_takes_its_own(rule: str) -> None:
    asked_of: list[int] = []

    def stray(question: TargetQuestion, picture: bytes) -> TargetProposal:
        asked_of.append(len(picture))
        return TargetProposal(target_m=OUTSIDE[rule], reason="a model saw something there")

    with staged(proposer=Proposer(name="vision-model", propose=stray)) as stage:
        explored = Explored(stage)
        mission = explored.mission
        assert mission.status == "succeeded"
        for one in decisions(mission):
            assert isinstance(one.refused, Reason)
            assert (one.refused.code, one.refused.facts["rule"]) == ("target_refused", rule)
            assert one.planner == "vision-model"
        assert all(one.target_m != OUTSIDE[rule] for one in decisions(mission))
        assert min(asked_of) > 1000
        assert replay_mission(rewritten(stage.parts), mission.mission_id).differences == ()


def test_a_robot_that_is_lost_at_first_waits_before_it_looks_and_then_explores() -> None:
    with staged() as stage:
        explored = Explored(stage, "lost-localisation")
        assert explored.mission.status == "succeeded", explored.mission.reason
        assert [spend.action for spend in explored.mission.of(NodeId("view")).spends] == ["wait"]


def test_a_proposer_that_breaks_stops_nothing() -> None:
    def broken(question: TargetQuestion, picture: bytes) -> TargetProposal:
        raise TimeoutError("the model did not answer")

    with staged(proposer=Proposer(name="vision-model", propose=broken)) as stage:
        mission = Explored(stage).mission
        assert mission.status == "succeeded"
        assert all("TimeoutError: the model did not answer" in sentence(one.refused) for one in decisions(mission))


def test_an_admissible_proposal_is_taken_up_as_it_is() -> None:
    def last_edge(question: TargetQuestion, picture: bytes) -> TargetProposal | None:
        open_edges = [edge for edge in question.frontiers if nearest_edge(question) is not None]
        return TargetProposal(target_m=open_edges[-1].approach_m, reason="the last one") if open_edges else None

    with staged(proposer=Proposer(name="vision-model", propose=last_edge)) as stage:
        mission_id: MissionId = stage.begin(exploration())
        mission = stage.until(mission_id, lambda one: len(choices(required_contract(one))) > 0)
        (choice,) = choices(required_contract(mission)).values()
        assert (choice.refused, choice.reason, choice.planner) == ("", "the last one", "vision-model")
        assert choice.target_m != _own(stage, choice)


def _own(stage: Stage, choice: TargetChoice) -> Point | None:
    said = nearest_edge(decode(stage.runtime.record(choice.question).body, TargetQuestion))
    return said.target_m if said else None


def test_the_budget_of_targets_bounds_the_exploration(free: Explored) -> None:
    question = free.questions[0]
    grid = free.grid(question.map)
    target = decisions(free.mission)[0].target_m
    ways = Ways(grid, question.position_m)
    assert target_refusal(target, question=question, grid=grid, ways=ways) is None
    spent = target_refusal(target, question=replace(question, left=0), grid=grid, ways=ways)
    assert spent is not None and spent.rule == "over_budget"
    limit = required_contract(free.mission).node(NodeId("close")).recovery.local_replan
    assert [one.left for one in free.questions] == [limit - place for place in range(len(free.questions))]
    first = decisions(free.mission)[0]
    assert (first.planner, first.question) == (NEAREST_EDGE.name, digest(question))
