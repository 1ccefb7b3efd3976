"""From a goal in words to a task contract, or to an error that says where."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from harness.contracts.effects import Metric, Precondition, Relational, Symbolic, Temporal
from harness.contracts.errors import ContractInvalid, HarnessError, UnknownName
from harness.contracts.ids import NodeId, PlaceId, sha256
from harness.contracts.tasks import Node, TaskContract, TaskTemplate
from harness.contracts.values import digest
from harness.planning.compile import compile_contract
from tests.saying import raises_saying
from tests.unit.planning.building import GOAL, SITE, contract, template

Change = Callable[[dict[str, Any]], Any]
STAGES = ["request", "go", "panorama", "analysis", "delivery", "return", "report"]


def changed(node_id: str, change: Change) -> TaskTemplate:
    """The inspection template with one node changed."""
    whole = template()
    nodes = []
    for node in whole.nodes:
        copy = dict(node)
        if node["node_id"] == node_id:
            change(copy)
        nodes.append(copy)
    return replace(whole, nodes=tuple(nodes))


def without(*keys: str) -> Change:
    """Remove the last key under the path of the others."""

    def change(node: dict[str, Any]) -> None:
        *path, last = keys
        inside: Any = node
        for key in path:
            copy = dict(inside[key]) if isinstance(inside[key], dict) else list(inside[key])
            if isinstance(copy, list):
                copy[0] = {**copy[0], "effect": dict(copy[0]["effect"])}
                inside[key], inside = copy, copy[0]["effect"]
            else:
                inside[key], inside = copy, copy
        del inside[last]

    return change


def compiled(whole: TaskTemplate, **arguments: str | float) -> TaskContract:
    return compile_contract(goal=GOAL, template=whole, arguments=arguments, site=SITE)


@pytest.mark.ledger("R1", "R2", "R5", symbol="harness.planning.compile:compile_contract")
def test_a_goal_becomes_goal_graph_conditions_constraints_and_budgets() -> None:
    task = contract()
    assert (task.goal.text, task.goal.digest) == (GOAL, sha256(GOAL.encode()))
    assert [node.node_id for node in task.nodes] == STAGES
    assert [condition.condition_id for condition in task.completion_conditions] == [
        "goal.linked", "goal.delivered", "goal.one_subject", "goal.in_order", "goal.home", "goal.reported",
    ]  # fmt: skip
    assert task.constraints.speed_cap_mps == 0.5
    assert set(task.constraints.resources) == {"mobile_base", "camera", "outbox", "speaker"}
    assert task.recovery_total == 8
    assert (task.frame, task.map_version) == ("map", SITE.map_version)


@pytest.mark.ledger("R195", "R196", symbol="harness.planning.compile:compile_contract")
def test_the_profile_adds_return_and_report_which_the_words_do_not_ask_for() -> None:
    task = contract()
    assert [node.capabilities[0] for node in task.nodes] == [
        "take_request", "navigate", "capture_panorama", "analyse_passage", "deliver_message", "navigate", "speak",
    ]  # fmt: skip
    assert "return" not in GOAL
    assert "report" not in GOAL
    assert task.node(NodeId("return")).depends_on == ("delivery",)
    assert task.node(NodeId("report")).depends_on == ("return",)


@pytest.mark.ledger("R192", "R198", symbol="harness.planning.binding:bind_place")
def test_the_destination_is_bound_to_the_office_storage_and_the_anchor_to_departure_and_return() -> None:
    task = contract()
    storage = next(place for place in SITE.places if place.place_id == "office_storage")
    anchor = next(place for place in SITE.places if place.place_id == "anchor_a")
    assert task.node(NodeId("go")).parameters["target"] == storage.approach_m
    assert task.node(NodeId("return")).parameters["target"] == anchor.approach_m
    route = task.node(NodeId("go")).parameters["route"]
    assert isinstance(route, tuple)
    assert (route[0], route[-1]) == (anchor.approach_m, storage.approach_m)


@pytest.mark.ledger("R194", symbol="harness.planning.compile:compile_contract")
def test_the_contract_keeps_anchors_as_configured_places_not_as_perceived_facts() -> None:
    bound = contract().bindings
    for name in ("destination", "home"):
        assert bound[name]["verification"] == "configured"
        assert bound[name]["provenance"] == "surveyed with the map"


@pytest.mark.ledger("R193", symbol="harness.planning.compile:compile_contract")
def test_a_further_place_on_the_site_leaves_the_contract_as_it_was() -> None:
    yard = replace(SITE.places[0], place_id=PlaceId("yard"), name="Yard", aliases=("outside",), approach_m=(50.0, 50.0))
    larger = replace(SITE, places=(*SITE.places, yard))
    again = compile_contract(goal=GOAL, template=template(), arguments={}, site=larger)
    assert digest(again) == digest(contract())


@pytest.mark.ledger("R210", "R213", symbol="harness.planning.compile:compile_contract")
@pytest.mark.parametrize(("name", "nodes"), [("warehouse-inspection", ["go", "return"]), ("circuit", ["circuit"])])
def test_every_segment_has_the_trial_settings_and_the_arrival_radius(name: str, nodes: list[str]) -> None:
    for node_id in nodes:
        node = contract(name).node(NodeId(node_id))
        assert (node.parameters["speed_cap_mps"], node.parameters["lookahead_m"]) == (0.5, 0.6)
        effect = node.success_conditions[0].effect
        assert isinstance(effect, Metric)
        assert effect.tolerance_m == node.parameters["tolerance_m"] == 0.40
        assert effect.route_m == node.parameters["route"]


@pytest.mark.ledger("R20", symbol="harness.planning.compile:_check_spans_nodes")
def test_a_goal_of_several_nodes_needs_a_condition_that_no_node_tests_by_itself() -> None:
    whole = template()
    own = [condition for condition in whole.completion_conditions if condition["condition_id"] == "goal.home"]
    with raises_saying(ContractInvalid, match="No completion condition spans several stages"):
        compiled(replace(whole, completion_conditions=tuple(own)))
    analysis = msgspec.to_builtins(contract().node(NodeId("analysis")).success_conditions[0].effect)
    borrowed = {"condition_id": "goal.same", "text": "As the node says", "effect": analysis}
    with raises_saying(ContractInvalid, match="No completion condition spans several stages"):
        compiled(replace(whole, completion_conditions=(*own, borrowed)))


def test_the_inspection_asks_for_evidence_of_looking_and_telling_as_well_as_of_moving() -> None:
    task = contract()
    order = next(c.effect for c in task.completion_conditions if c.condition_id == "goal.in_order")
    linked = next(c.effect for c in task.completion_conditions if c.condition_id == "goal.linked")
    assert isinstance(order, Temporal)
    assert order.nodes == tuple(STAGES)
    assert isinstance(linked, Relational)
    assert all(node.required for node in task.nodes)
    assert "receipts" in task.node(NodeId("report")).evidence.mandatory


def test_the_return_waits_for_a_delivery_of_four_images_that_was_read_back() -> None:
    task = contract()
    back, delivery = task.node(NodeId("return")), task.node(NodeId("delivery"))
    assert back.depends_on == ("delivery",)
    assert back.runs_after_failure
    effect = delivery.success_conditions[0].effect
    assert isinstance(effect, Symbolic)
    assert (effect.predicate, effect.arguments["images"]) == ("message_stored", "4")


def test_the_panorama_needs_the_robot_at_the_place_and_static() -> None:
    panorama = contract().node(NodeId("panorama"))
    here = Precondition(predicate="at_place", target_m=SITE.places[1].approach_m, tolerance_m=0.40)
    assert here in panorama.preconditions
    assert Precondition(predicate="static") in panorama.preconditions


@pytest.mark.ledger("R8", symbol="harness.planning.compile:compile_contract")
@pytest.mark.parametrize(
    "field",
    ["subgoal", "success_conditions", "capabilities", "parameters", "resources", "evidence", "timeout_s", "recovery"],
)
def test_each_of_the_eight_fields_of_a_node_is_mandatory(field: str) -> None:
    with raises_saying(ContractInvalid, match=f"missing required field `{field}`") as error:
        compiled(changed("go", without(field)))
    assert "$.nodes.go" in str(error.value.where)


@pytest.mark.ledger("R7", symbol="harness.planning.compile:compile_contract")
@pytest.mark.parametrize("field", ["success_conditions", "capabilities"])
def test_a_node_without_any_effect_or_capability_is_refused(field: str) -> None:
    with raises_saying(ContractInvalid, match="length >= 1") as error:
        compiled(changed("panorama", lambda node: node.update({field: []})))
    assert f"$.nodes.panorama.{field}" in str(error.value.where)


@pytest.mark.ledger("R17", symbol="harness.planning.compile:compile_contract")
@pytest.mark.parametrize("field", ["frame", "target_m", "tolerance_m"])
def test_a_target_without_frame_position_or_tolerance_is_refused_with_its_path(field: str) -> None:
    with raises_saying(ContractInvalid, match=f"missing required field `{field}`") as error:
        compiled(changed("go", without("success_conditions", field)))
    assert "$.nodes.go.success_conditions[0].effect" in str(error.value.where)


@pytest.mark.ledger("R16", symbol="harness.planning.compile:compile_contract")
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"speed": "brisk"}, "unknown field `speed`"),
        ({"timeout_s": "soon"}, "Expected `float`, got `str`"),
        ({"timeout_s": -1.0}, "> 0"),
        ({"timeout_s": float("inf")}, "inf is not a finite number"),
        ({"risk": "daring"}, "“daring” is none of high, low, medium"),
        ({"capabilities": ["levitate now"]}, "Expected `str` matching regex"),
        ({"parameters": {"target": {"about": "there"}}}, "got `object`"),
        (
            {"preconditions": [{"predicate": "in the mood"}]},
            "none of at_place, hardware_stop_released, localised, static",
        ),
    ],
)
def test_free_prose_and_unknown_words_are_no_parameters(change: dict[str, Any], says: str) -> None:
    with raises_saying(ContractInvalid, match=says):
        compiled(changed("go", lambda node: node.update(change)))


@pytest.mark.ledger("R21", symbol="harness.planning.compile:compile_contract")
def test_the_graph_names_capabilities_and_no_provider() -> None:
    assert not [name for name in Node.__struct_fields__ if "provider" in name]
    with raises_saying(ContractInvalid, match="unknown field `provider`"):
        compiled(changed("go", lambda node: node.update(provider="route-follower")))


def test_a_cycle_is_refused_when_the_contract_is_compiled() -> None:
    with raises_saying(ContractInvalid, match="cycle through request, go"):
        compiled(changed("request", lambda node: node.update(depends_on=["report"])))


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"destination": "the moon"}, UnknownName, "no place called “the moon”"),
        ({"destination": ""}, ContractInvalid, "is not a place"),
        ({"destination": 4.0}, ContractInvalid, "is not a place"),
        ({"destinaton": "B"}, UnknownName, "did you mean “destination”"),
        ({"destination": "A"}, UnknownName, "No passage lies within anchor_a"),
        ({"destination": "x" * 1000}, ContractInvalid, "has 1000 characters"),
    ],
)
def test_arguments_that_cannot_be_bound_are_typed_errors(
    arguments: dict[str, Any], error: type[HarnessError], says: str
) -> None:
    routes = tuple(route for route in SITE.routes if route.name != "circuit")
    with raises_saying(error, match=says):
        compile_contract(goal=GOAL, template=template(), arguments=arguments, site=replace(SITE, routes=routes))


@pytest.mark.parametrize(
    ("value", "says"), [("far", "“far” is not a number"), (float("nan"), "not a number"), (True, "not a number")]
)
def test_a_number_must_be_one(value: Any, says: str) -> None:
    given = {"target_x_m": value, "target_y_m": 0.0, "frame": "odom", "map_version": "recording:ab"}
    with raises_saying(ContractInvalid, match=says):
        compiled(template("recording"), **given)


def test_a_parameter_without_default_must_be_given() -> None:
    with raises_saying(ContractInvalid, match="Target, x in metres is not given"):
        compiled(template("recording"))


def test_a_replay_takes_target_and_frame_from_its_arguments_and_has_no_recovery() -> None:
    task = contract("recording", target_x_m="3.5", target_y_m=-2.0, frame="odom", map_version="recording:ab")
    effect = task.nodes[0].success_conditions[0].effect
    assert isinstance(effect, Metric)
    assert (effect.target_m, effect.frame, effect.map_version) == ((3.5, -2.0), "odom", "recording:ab")
    assert (task.frame, task.map_version) == ("odom", "recording:ab")
    assert (task.recovery_total, task.nodes[0].recovery.total, task.nodes[0].risk) == (0, 0, "low")


def test_an_empty_or_huge_goal_compiles_to_nothing() -> None:
    for goal in ("", "x" * 10_000_000):
        with raises_saying(ContractInvalid, match="The goal"):
            compile_contract(goal=goal, template=template(), arguments={}, site=SITE)


def test_the_same_request_compiles_to_the_same_bytes() -> None:
    assert digest(contract()) == digest(contract(destination="B", home="the dock"))
