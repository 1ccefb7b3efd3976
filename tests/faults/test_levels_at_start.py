"""A level of independence that a robot's sources cannot give is refused by name before anything moves (D17, D42)."""

from typing import Any, get_args

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.messaging.read_back import SOURCE as READ_PATH
from harness.assembly import local_services
from harness.baseline.load import baseline
from harness.baseline.load import site as shipped_site
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import Unsatisfiable
from harness.contracts.events import VerdictRecorded
from harness.contracts.observations import Source
from harness.contracts.places import Site
from harness.contracts.reasons import Reason
from harness.contracts.tasks import TaskTemplate
from harness.goals.sources import RESTS_ON, Reachable, RobotSources
from harness.projections.mission import required_contract
from harness.provider_protocol.delegation import DelegatingProvider
from harness.verification.predicates.registry import PREDICATES
from simulator.camera import CAMERA
from tests.builders.connections import Stage, only, staged, template, with_node
from tests.builders.declared import two_pictures
from tests.builders.pointers import DECIDERS, release, select

INSPECTION = "warehouse-inspection"
ZH = "zh-Hans"


def asking(node_id: str, *, level: int = 2, of: str = INSPECTION) -> TaskTemplate:
    """The shipped template whose first condition of that stage asks for this level."""
    base = template(of)
    node = next(one for one in base.nodes if one["node_id"] == node_id)
    first, *others = node["success_conditions"]
    return with_node(base, node_id, success_conditions=[first | {"independence": level}, *others])


def vouching(*sources: str) -> Site:
    return replace(shipped_site(), vouched=sources)


def refused(task: TaskTemplate, site: Site | None = None) -> Unsatisfiable:
    with staged(site=site) as stage:
        with pytest.raises(Unsatisfiable) as error:
            stage.begin(task)
        assert stage.runtime.missions() == []
        return error.value


def facts(error: Unsatisfiable) -> dict[str, Any]:
    assert isinstance(error.what, Reason)
    return {"code": error.what.code, **error.what.facts}


def sources_of(stage: Stage) -> RobotSources:
    """What the harness was told of this robot when it was connected."""
    beside = local_services(stage.parts, camera=CAMERA, folder=None, room=stage.robot.room)
    own = stage.robot.providers()
    origins = {
        **dict.fromkeys(get_args(Source), "robot"),
        **{one.card.provider_id: "robot" for one in own},
        **{one.card.provider_id: "harness" for one in beside.providers},
    }
    cards = tuple(one.card for one in (*own, *beside.providers))
    return RobotSources(measures=frozenset(one.predicate for one in beside.sources), cards=cards, origins=origins)


def test_every_predicate_says_what_its_answer_rests_on() -> None:
    assert {name for _, name in PREDICATES} == {*RESTS_ON, "stable"}


@pytest.mark.parametrize(("stage", "of"), [("delivery", INSPECTION), ("circuit", "circuit")])
def test_a_level_that_the_sources_cannot_give_is_refused_with_what_is_missing(stage: str, of: str) -> None:
    error = refused(asking(stage, of=of))
    found = facts(error)
    assert (found["code"], found["level"], found["required"]) == ("level_out_of_reach", 1, 2)
    assert error.where == f"nodes.{stage}" and found["sources"]
    said = sentence(error.what)
    assert "needs evidence of independence 2" in said and "reaches 1" in said
    assert sentence(error.what, ZH) != said


class Blind(DelegatingProvider):
    """A navigator that steers by its wheels alone: pose and odometry are none of its own sensors."""

    @property
    def card(self) -> CapabilityCard:
        return replace(self.inner.card, sources=("wheels",))


def test_a_source_that_the_site_vouches_for_gives_the_level_and_the_mission_reaches_it() -> None:
    blind = only("navigate", Blind)
    with staged(wrap=blind, site=vouching("localiser", "odometry")) as stage:
        ran = stage.run(stage.begin(asking("circuit", of="circuit")))
        assert ran.mission.status == "succeeded", sentence(ran.mission.reason)
        (fact,) = [one for one in ran.mission.facts if one.condition_id == "circuit.closed"]
        assert fact.independence == 2
    with staged(wrap=blind) as stage, pytest.raises(Unsatisfiable):
        stage.begin(asking("circuit", of="circuit"))


def test_a_vouched_source_does_not_lift_what_rests_on_weaker_facts() -> None:
    """The message is of an analysis of level 1: reading it back from elsewhere makes it no better than that."""
    assert facts(refused(asking("delivery"), vouching(READ_PATH)))["level"] == 1


def test_vouching_for_the_provider_s_own_sensors_changes_nothing() -> None:
    assert facts(refused(asking("circuit", of="circuit"), vouching("localiser", "odometry")))["level"] == 1


def test_a_high_risk_leg_asks_for_more_than_one_robot_s_sensors_can_show() -> None:
    found = facts(refused(with_node(template("circuit"), "circuit", risk="high")))
    assert (found["level"], found["required"]) == (1, 2)


def test_a_condition_that_only_its_provider_can_show_is_refused_unless_it_is_declared_or_attested() -> None:
    alone = two_pictures(declared=False)
    describe = dict(alone.nodes[2])
    describe["evidence"] = {"mandatory": ["receipts"]}
    found = facts(refused(replace(alone, nodes=(*alone.nodes[:2], describe))))
    assert (found["code"], found["condition_id"]) == ("word_alone", "describe.of_picture")


def test_a_configuration_that_asks_for_too_much_does_not_begin_what_was_compiled_before_it() -> None:
    stern = replace(
        baseline(), templates=tuple(asking("circuit", of="circuit") if one.name == "circuit" else one
                                    for one in baseline().templates)
    )  # fmt: skip
    with staged(deciders=DECIDERS, select=select) as stage:
        mission_id = stage.begin("circuit")
        release(stage.runtime, stern)
        ran = stage.run(mission_id)
        assert ran.mission.status == "failed" and "independence 2" in sentence(ran.mission.reason)
        assert ran.verdicts("circuit") == [], "nothing moved"


def test_what_was_computed_before_the_start_is_what_the_verifier_found() -> None:
    with staged() as stage:
        ran = stage.run(stage.begin(INSPECTION))
        contract = required_contract(ran.mission)
        reachable = Reachable(contract, sources_of(stage))
        told = [event.verdict for event in ran.events if isinstance(event, VerdictRecorded)]
        found = {one.condition_id: one.independence for verdict in told for one in verdict.results}
        for node in contract.nodes:
            for one in node.success_conditions:
                assert found[one.condition_id] == reachable.of_stage(one, node), one.condition_id
        assert ran.mission.goal_verdict is not None
        for result, one in zip(ran.mission.goal_verdict.results, contract.completion_conditions, strict=True):
            assert result.independence == reachable.of_goal(one), one.condition_id
