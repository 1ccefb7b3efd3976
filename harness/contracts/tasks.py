"""The task contract T = (g, G, C_g, S, R): goal, graph, original completion conditions, constraints, budgets."""

from collections.abc import Iterator
from typing import Annotated, Any

import msgspec

from harness.contracts.capabilities import Capability, Risk
from harness.contracts.effects import Condition, Metric, Precondition, Temporal
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest, NodeId, PlaceId, ResourceId
from harness.contracts.protocol import Parameters
from harness.contracts.reasons import because
from harness.contracts.values import Count, Name, Positive, Value


class Goal(Value):
    """The user's own words. `digest` is the SHA-256 of the text in UTF-8: the transcript checksum."""

    text: Annotated[str, msgspec.Meta(min_length=1, max_length=2000)]
    digest: Digest


class RecoveryLimits(Value):
    """How often each recovery action may be authorised for a node, and all of them together (D24)."""

    re_perceive: Count
    adjust_view: Count
    retry: Count
    local_replan: Count
    switch_skill: Count
    total: Count


class EvidencePolicy(Value):
    """What a packet must hold for this node, how old it may be, and whether a person may attest (D17)."""

    mandatory: tuple[Name, ...]
    pose_age_s: Positive = 1.0
    image_age_s: Positive = 30.0
    minimum_confidence: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.5
    attestation: bool = False


class Node(Value):
    """One stage: the paper's eight fields, and its position in the graph."""

    node_id: NodeId
    subgoal: Name
    success_conditions: Annotated[tuple[Condition, ...], msgspec.Meta(min_length=1)]
    capabilities: Annotated[tuple[Capability, ...], msgspec.Meta(min_length=1)]
    parameters: Parameters
    resources: tuple[ResourceId, ...]
    evidence: EvidencePolicy
    timeout_s: Positive
    recovery: RecoveryLimits
    depends_on: tuple[NodeId, ...] = ()
    preconditions: tuple[Precondition, ...] = ()
    required: bool = True
    risk: Risk = "low"
    runs_after_failure: bool = False


class Constraints(Value):
    """S: safety and resource constraints. A plugin may add one; nothing removes one (R172)."""

    speed_cap_mps: Positive
    keep_out: tuple[PlaceId, ...] = ()
    resources: tuple[ResourceId, ...] = ()
    minimum_charge: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.15


class TaskContract(Value):
    """One compiled request. `template` and `site` say what it was compiled from."""

    goal: Goal
    nodes: Annotated[tuple[Node, ...], msgspec.Meta(min_length=1)]
    completion_conditions: Annotated[tuple[Condition, ...], msgspec.Meta(min_length=1)]
    constraints: Constraints
    recovery_total: Count
    template: Name
    frame: Name
    map_version: Name
    bindings: dict[str, Any] = msgspec.field(default_factory=dict)

    def node(self, node_id: NodeId) -> Node:
        """Raises UnknownName."""
        found = next((node for node in self.nodes if node.node_id == node_id), None)
        if found is None:
            raise UnknownName(because("node_unknown", node_id=node_id), where="contract")
        return found


class TemplateParameter(Value):
    """One thing the person may choose when starting a mission."""

    name: Name
    type: Annotated[str, msgspec.Meta(pattern="^(place|text|number)$")]
    title: Name
    default: str | float | None = None


class TaskTemplate(Value):
    """A task contract with open places. Strings `${name.field}` are bound by planning; the rest is literal."""

    name: Name
    version: Name
    title: Name
    goal: Name
    phrases: tuple[Name, ...]
    parameters: tuple[TemplateParameter, ...]
    nodes: tuple[dict[str, Any], ...]
    completion_conditions: tuple[dict[str, Any], ...]
    constraints: dict[str, Any]
    recovery_total: Count


def check(contract: TaskContract) -> None:
    """Raise ContractInvalid for the first broken rule: names, dependencies, no cycle, required stages, frame."""
    names = [node.node_id for node in contract.nodes]
    for name in names:
        if names.count(name) > 1:
            raise ContractInvalid(because("node_twice", name=name), where="nodes")
    for node in contract.nodes:
        for dependency in node.depends_on:
            if dependency not in names:
                raise ContractInvalid(
                    because("dependency_unknown", node_id=node.node_id, dependency=dependency, names=tuple(names)),
                    where=f"nodes.{node.node_id}.depends_on",
                )
    order(contract)
    if not any(node.required for node in contract.nodes):
        raise ContractInvalid(because("no_required_node"), where="nodes")
    _check_required(contract)
    for where, condition in _conditions(contract):
        effect = condition.effect
        if isinstance(effect, Metric) and (effect.frame, effect.map_version) != (contract.frame, contract.map_version):
            raise ContractInvalid(
                because(
                    "condition_frame_differs",
                    condition_id=condition.condition_id,
                    frame=effect.frame,
                    map_version=effect.map_version,
                    contract_frame=contract.frame,
                    contract_map=contract.map_version,
                ),
                where=where,
            )
        if isinstance(effect, Temporal) and not set(effect.nodes) <= set(names):
            raise ContractInvalid(
                because("condition_of_unknown_nodes", condition_id=condition.condition_id), where=where
            )


def _check_required(contract: TaskContract) -> None:
    """A stage that the goal needs cannot wait for one that may be skipped (R12)."""
    optional = {node.node_id for node in contract.nodes if not node.required}
    for node in contract.nodes:
        waits_for = sorted(optional & set(node.depends_on)) if node.required else []
        if waits_for:
            raise ContractInvalid(
                because("required_on_optional", node_id=node.node_id, waits_for=tuple(waits_for)),
                where=f"nodes.{node.node_id}.depends_on",
            )


def order(contract: TaskContract) -> tuple[NodeId, ...]:
    """Nodes in an order that respects dependencies, ties as declared; raises ContractInvalid on a cycle."""
    done: list[NodeId] = []
    left = list(contract.nodes)
    while left:
        ready = next((node for node in left if set(node.depends_on) <= set(done)), None)
        if ready is None:
            raise ContractInvalid(because("graph_cycle", nodes=tuple(node.node_id for node in left)), where="nodes")
        done.append(ready.node_id)
        left.remove(ready)
    return tuple(done)


def _conditions(contract: TaskContract) -> Iterator[tuple[str, Condition]]:
    for node in contract.nodes:
        for condition in node.success_conditions:
            yield f"nodes.{node.node_id}.success_conditions", condition
    for condition in contract.completion_conditions:
        yield "completion_conditions", condition
