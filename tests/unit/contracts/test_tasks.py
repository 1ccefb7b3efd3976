"""The rules of a graph: names, dependencies, order, frames, and what is required."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from app.i18n.reasons.rendering import remedy
from harness.contracts.effects import Metric
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId
from harness.contracts.tasks import Node, TaskContract, check, order
from harness.projections.mission import all_required_settled, failed
from tests.saying import raises_saying
from tests.unit.planning.building import contract, mission

NAMES = [NodeId(name) for name in "abcdef"]


def graph(**depends_on: str) -> TaskContract:
    """A contract whose nodes depend on the nodes named by the letters."""
    pattern = contract("circuit").nodes[0]
    nodes = tuple(
        replace(pattern, node_id=NodeId(name), depends_on=tuple(NodeId(letter) for letter in letters))
        for name, letters in depends_on.items()
    )
    return replace(contract("circuit"), nodes=nodes, completion_conditions=pattern.success_conditions)


def only(node_id: str, **changes: Any) -> TaskContract:
    """The inspection with one node changed."""
    task = contract()
    nodes = tuple(replace(node, **changes) if node.node_id == node_id else node for node in task.nodes)
    return replace(task, nodes=nodes)


@pytest.mark.ledger("R3", symbol="harness.contracts.tasks:order")
@pytest.mark.parametrize("depends_on", [{"a": "a"}, {"a": "b", "b": "a"}, {"a": "", "b": "ad", "c": "b", "d": "c"}])
def test_a_cycle_is_refused_and_named(depends_on: dict[str, str]) -> None:
    with raises_saying(ContractInvalid, match="The graph has a cycle through"):
        check(graph(**depends_on))


@pytest.mark.ledger("R3", symbol="harness.contracts.tasks:check")
def test_a_dependency_on_an_unknown_node_is_refused_with_the_names_that_exist() -> None:
    with raises_saying(ContractInvalid, match="Stage b depends on z, which the graph does not have") as error:
        check(graph(a="", b="z"))
    assert (error.value.where, remedy(error.value)) == ("nodes.b.depends_on", "name one of a, b")


def test_two_nodes_of_one_name_are_refused() -> None:
    task = graph(a="")
    with raises_saying(ContractInvalid, match="Two stages are called a"):
        check(replace(task, nodes=task.nodes * 2))


def test_a_graph_in_which_nothing_is_required_is_refused() -> None:
    task = contract()
    with raises_saying(ContractInvalid, match="No stage is required"):
        check(replace(task, nodes=tuple(replace(node, required=False) for node in task.nodes)))


@pytest.mark.ledger("R17", symbol="harness.contracts.tasks:check")
@pytest.mark.parametrize("change", [{"frame": "odom"}, {"map_version": "site-0"}])
def test_a_target_in_another_frame_or_map_is_refused(change: dict[str, str]) -> None:
    condition = contract().node(NodeId("go")).success_conditions[0]
    assert isinstance(condition.effect, Metric)
    moved = replace(condition, effect=replace(condition.effect, **change))
    with raises_saying(ContractInvalid, match="is stated in") as error:
        check(only("go", success_conditions=(moved,)))
    assert error.value.where == "nodes.go.success_conditions"
    with raises_saying(ContractInvalid, match="is stated in"):
        check(replace(contract(), completion_conditions=(moved,)))


def test_an_order_over_unknown_nodes_is_refused() -> None:
    task = contract()
    conditions = [c for c in task.completion_conditions if c.condition_id == "goal.in_order"]
    strange = replace(conditions[0], effect=replace(conditions[0].effect, nodes=("request", "lunch")))
    with raises_saying(ContractInvalid, match="names unknown stages"):
        check(replace(task, completion_conditions=(strange,)))


@given(edges=st.sets(st.tuples(st.integers(0, 5), st.integers(0, 5)).filter(lambda edge: edge[0] > edge[1])))
def test_every_acyclic_graph_has_an_order_that_respects_it_and_ties_stay_as_declared(
    edges: set[tuple[int, int]],
) -> None:
    depends_on = {name: "".join(NAMES[b] for a, b in sorted(edges) if NAMES[a] == name) for name in NAMES}
    task = graph(**depends_on)
    check(task)
    assert order(task) == tuple(NAMES)
    backwards = order(replace(task, nodes=task.nodes[::-1]))
    for later, sooner in edges:
        assert backwards.index(NAMES[sooner]) < backwards.index(NAMES[later])


@pytest.mark.ledger("R12", symbol="harness.projections.mission:all_required_settled")
def test_an_optional_node_does_not_keep_the_goal_check_waiting() -> None:
    task = only("delivery", required=False)
    states = {node.node_id: "committed" if node.required else "pending" for node in task.nodes}
    whole = mission(task)

    def with_states(**changes: str) -> Any:
        nodes = {name: replace(node, status=(states | changes)[name]) for name, node in whole.nodes.items()}  # type: ignore[arg-type]
        return replace(whole, nodes=nodes)

    assert all_required_settled(with_states())
    assert not all_required_settled(with_states(analysis="executed"))
    assert failed(with_states(analysis="failed"))
    assert not failed(with_states(delivery="failed"))


def test_the_completion_conditions_of_a_contract_cannot_be_changed() -> None:
    task = contract()
    tries: list[Callable[[], None]] = [
        lambda: setattr(task, "completion_conditions", ()),
        lambda: setattr(task.completion_conditions[0], "text", "anything"),
        lambda: setattr(task.completion_conditions[0].effect, "predicate", "always"),
    ]
    for change in tries:
        with pytest.raises(AttributeError):
            change()
    assert isinstance(task.completion_conditions, tuple)


def test_a_contract_survives_its_own_bytes() -> None:
    for name in ("warehouse-inspection", "circuit"):
        task = contract(name)
        assert msgspec.json.decode(msgspec.json.encode(task), type=TaskContract) == task


def test_a_node_has_eight_fields_that_must_be_stated() -> None:
    fields = msgspec.structs.fields(Node)
    assert [field.name for field in fields if field.required and field.name != "node_id"] == [
        "subgoal", "success_conditions", "capabilities", "parameters", "resources", "evidence", "timeout_s", "recovery",
    ]  # fmt: skip
