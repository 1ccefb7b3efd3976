"""Skill, provider and harness mean in the log what the paper means by them (R24)."""

import ast
from collections.abc import Iterator

import pytest

from harness.contracts.events import DispatchIntended
from harness.gate.decide import DECIDER
from harness.projections.mission import required_contract
from tests.architecture.sources import Module, modules
from tests.builders.missions_run import ROBOT, Ran, ran

MINDS = {"anthropic", "openai", "pydantic_ai", "torch", "transformers"}
BODIES = {"cyclonedds", "mujoco", "rclpy", "serial", "unitree_sdk2py"}


def intents(run: Ran) -> list[DispatchIntended]:
    told = [DECIDER.codec.decode(event) for event in run.harness.runtime.events(run.mission.mission_id)]
    return [event for event in told if isinstance(event, DispatchIntended)]


@pytest.mark.ledger("R24", symbol="harness.supervisor.dispatch:Dispatcher._intent")
def test_a_skill_is_a_bounded_operation_that_a_provider_implements_and_the_harness_runs() -> None:
    with ran("circuit", "early-success") as run:
        assert run.mission.status == "succeeded"
        cards = {one.card.provider_id: one.card for one in run.harness.robots[ROBOT].providers()}
        contract, sent = required_contract(run.mission), intents(run)
        moving = [one for one in sent if one.moves]
        assert len(moving) > 1
        for one in sent:
            assert one.capability in (*contract.node(one.node_id).capabilities, "observe")
            assert 0 < one.deadline_s - one.dispatched_s <= contract.node(one.node_id).timeout_s
        for one in moving:
            card = cards[one.provider_id]
            assert (card.capability, card.version) == (one.capability, one.provider_version)
            assert set(card.resources) == set(one.resources)
            assert set(one.parameters) <= {parameter.name for parameter in card.parameters}
        started = [start.request_id for start in run.harness.starts(run.mission.mission_id) if start.moves]
        assert started == [one.request_id for one in moving]


def imported(source: Module) -> Iterator[str]:
    """Top names of what a file imports."""
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Import):
            yield from (one.name.partition(".")[0] for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.partition(".")[0]


def test_the_harness_is_neither_a_model_nor_a_controller() -> None:
    """Models and bodies are reached through a provider's port: only adapters and the simulator know their libraries."""
    inside = [one for one in modules("harness") if not one.path.startswith("harness/adapters/")]
    assert len(inside) > 80
    found = {one.path: set(imported(one)) & (MINDS | BODIES) for one in inside}
    assert {path: names for path, names in found.items() if names} == {}
    assert any(set(imported(one)) & BODIES for one in modules("simulator"))
