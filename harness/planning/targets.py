"""Extends an exploring contract by targets, and checks which ones a revision may add (R222). Pure.

A choice is stored in the contract's bindings under `targets`, by the name of the leg that goes there.
"""

from typing import Any

import msgspec
from msgspec.structs import replace

from harness.contracts.decisions import Refused, refused
from harness.contracts.effects import Condition, Metric
from harness.contracts.errors import ContractInvalid
from harness.contracts.exploration import TargetChoice
from harness.contracts.ids import ConditionId, NodeId
from harness.contracts.reasons import because
from harness.contracts.tasks import Node, RecoveryLimits, TaskContract
from harness.contracts.values import Point, encode
from harness.planning import legs
from harness.projections.exploration import TARGETS, choices
from harness.projections.mission import Mission, required_contract

EXPLORES, COVERAGE, REGION = "explores", "coverage", "region"
"""Parameters of the stage that stays open while there is something to explore.

`coverage` is the share of the reachable floor that is to be seen, of `region` where that is given, else of all zones.
Older contracts state `explores`, how many views are wanted.
"""
LEG, LOOK = "leg", "look"
TIMEOUT_S = 120.0
LEG_BUDGET = RecoveryLimits(re_perceive=2, adjust_view=2, retry=1, local_replan=0, switch_skill=1, total=4)
"""A leg that is blocked tries one other provider; then it is given up, since another target may serve as well."""


def exploring(contract: TaskContract) -> Node | None:
    """The stage that waits until the exploration is over; None for a contract that explores nothing."""
    return next((node for node in contract.nodes if {EXPLORES, COVERAGE} & node.parameters.keys()), None)


def extended(contract: TaskContract, choice: TargetChoice, *, route_m: tuple[Point, ...]) -> TaskContract:
    """The contract with a leg to the target and a look from there, both before the stage that closes it.

    Neither is required: a target that cannot be reached is given up, and another one chosen. Raises ContractInvalid
    if the contract explores nothing.
    """
    closing = exploring(contract)
    if closing is None or not closing.depends_on:
        raise ContractInvalid(because("explores_nothing"), where="nodes")
    number = len(choices(contract)) + 1
    leg, look = _stages(contract, closing, choice, number=number, route_m=route_m)
    at = contract.nodes.index(closing)
    bound: dict[str, Any] = msgspec.json.decode(encode(contract.bindings.get(TARGETS, {})))
    targets = {**bound, leg.node_id: msgspec.json.decode(encode(choice))}
    return replace(
        contract,
        nodes=(*contract.nodes[:at], leg, look, *contract.nodes[at:]),
        bindings={**contract.bindings, TARGETS: targets},
    )


def choice_refusal(mission: Mission, proposed: TaskContract) -> Refused | None:
    """Why a revision may not bring its targets: each new one belongs to this mission, its configuration and its k.

    Earlier choices and the other bindings stay as they are; a leg leads to its own target and nowhere else.
    """
    current = required_contract(mission)
    before, after = choices(current), choices(proposed)
    for name in {*current.bindings, *proposed.bindings} - {TARGETS}:
        if current.bindings.get(name) != proposed.bindings.get(name):
            return refused("bindings_changed", field=name)
    if any(after.get(name) != choice for name, choice in before.items()):
        return refused("history_changed", because("chosen_target_changed"))
    nodes = {node.node_id: node for node in proposed.nodes}
    for name in after.keys() - before.keys():
        if broken := _foreign(mission, after[name]) or _elsewhere(nodes.get(name), name, after[name]):
            return broken
    known = {node.node_id for node in current.nodes}
    moving = (node for node in proposed.nodes if "navigate" in node.capabilities and node.node_id not in known)
    unbound = [node.node_id for node in moving if exploring(current) and node.node_id not in after]
    return refused("target_unbound", nodes=tuple(unbound)) if unbound else None


def _foreign(mission: Mission, choice: TargetChoice) -> Refused | None:
    if choice.mission_id != mission.mission_id:
        return refused("foreign_target", mission_id=choice.mission_id)
    if choice.configuration != mission.configuration:
        pinned = mission.configuration[:12]
        return refused(
            "wrong_configuration",
            because("target_of_another_configuration", configuration=choice.configuration[:12], pinned=pinned),
        )
    if choice.k != mission.k:
        return refused("obsolete_target", k=choice.k, mission_k=mission.k)
    return None


def _elsewhere(leg: Node | None, name: NodeId, choice: TargetChoice) -> Refused | None:
    effects = [one.effect for one in leg.success_conditions] if leg else []
    arrivals = [one.target_m for one in effects if isinstance(one, Metric)]
    if leg is None or leg.parameters.get("target") != choice.target_m or arrivals != [choice.target_m]:
        return refused("another_target", node_id=name)
    return None


def _stages(
    contract: TaskContract, closing: Node, choice: TargetChoice, *, number: int, route_m: tuple[Point, ...]
) -> tuple[Node, Node]:
    """The leg to the target, and the same look as the first one from there."""
    name = NodeId(f"{LEG}-{number}")
    x, y = choice.target_m
    leg = legs.leg(
        contract,
        name,
        choice.target_m,
        subgoal=f"Go to ({x:.1f}, {y:.1f})",
        arrived="The body is at the chosen target, measured",
        route_m=route_m,
        depends_on=closing.depends_on,
        timeout_s=TIMEOUT_S,
        recovery=LEG_BUDGET,
        required=False,
    )
    first = contract.node(closing.depends_on[-1])
    look = replace(
        first,
        node_id=NodeId(f"{LOOK}-{number}"),
        subgoal=f"Look around at ({x:.1f}, {y:.1f})",
        success_conditions=tuple(_renamed(one, f"{LOOK}-{number}") for one in first.success_conditions),
        depends_on=(name,),
        required=False,
    )
    return leg, look


def _renamed(condition: Condition, name: str) -> Condition:
    return replace(condition, condition_id=ConditionId(f"{name}.{condition.condition_id.partition('.')[2]}"))
