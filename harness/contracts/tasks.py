"""The task contract T = (g, G, C_g, S, R): goal, graph, original completion conditions, constraints, budgets."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any

import msgspec

from harness.contracts.capabilities import Capability, Risk
from harness.contracts.effects import (
    AnyEffect,
    Condition,
    Metric,
    Precondition,
    Relational,
    Symbolic,
    Temporal,
    Visual,
)
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import ConditionId, Digest, NodeId, PlaceId, ResourceId
from harness.contracts.predicates import PinnedPredicate
from harness.contracts.protocol import Parameters
from harness.contracts.readings import PROFILE, Act, Clause, ObjectKind, Reading, clause_id
from harness.contracts.reasons import because
from harness.contracts.rules import FIRST_RULES, RETIRED, Retired, RulesVersion, required_independence
from harness.contracts.values import Count, Name, Point, Positive, Value


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
    """What a packet must hold for this node, how old it may be, and whether a person may attest (D17).

    `declared` names the node's conditions for which no other source than the provider can be had: the node may then
    end DECLARED instead of committed.
    """

    mandatory: tuple[Name, ...]
    pose_age_s: Positive = 1.0
    image_age_s: Positive = 30.0
    minimum_confidence: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.5
    attestation: bool = False
    declared: tuple[ConditionId, ...] | msgspec.UnsetType = msgspec.UNSET


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

    @property
    def declared(self) -> frozenset[ConditionId]:
        """The conditions that may rest on the provider's word alone, without being accepted."""
        named = self.evidence.declared
        return frozenset() if isinstance(named, msgspec.UnsetType) else frozenset(named)


class Constraints(Value):
    """S: safety and resource constraints. A plugin may add one; nothing removes one (R172)."""

    speed_cap_mps: Positive
    keep_out: tuple[PlaceId, ...] = ()
    resources: tuple[ResourceId, ...] = ()
    minimum_charge: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.15


class TaskContract(Value, dict=True, gc=True):
    """One compiled request. `template` says what it was compiled from: one template's name, or for people those of
    several; `templates` lists these, and is unset for one.

    `reading` is what the goal was understood as (D40); `confirmed` its digest where a person confirmed a reading that
    leaves words unread. Contracts of earlier releases, and of templates that take no goal in words, have neither.

    `predicates`: the installed predicates that conditions name, as
    they were installed when it was compiled (D57).
    """

    goal: Goal
    nodes: Annotated[tuple[Node, ...], msgspec.Meta(min_length=1)]
    completion_conditions: Annotated[tuple[Condition, ...], msgspec.Meta(min_length=1)]
    constraints: Constraints
    recovery_total: Count
    template: Name
    frame: Name
    map_version: Name
    bindings: dict[str, Any] = msgspec.field(default_factory=dict)
    reading: Reading | msgspec.UnsetType = msgspec.UNSET
    confirmed: Digest | msgspec.UnsetType = msgspec.UNSET
    templates: tuple[Name, ...] | msgspec.UnsetType = msgspec.UNSET
    predicates: dict[str, PinnedPredicate] | msgspec.UnsetType = msgspec.UNSET

    @property
    def pinned(self) -> Mapping[str, PinnedPredicate]:
        """The installed predicates that its conditions name, by name."""
        return {} if isinstance(self.predicates, msgspec.UnsetType) else self.predicates

    @property
    def compiled_from(self) -> tuple[str, ...]:
        """The names of its templates."""
        return (self.template,) if isinstance(self.templates, msgspec.UnsetType) else self.templates

    @cached_property
    def _by_id(self) -> dict[NodeId, Node]:
        return {node.node_id: node for node in reversed(self.nodes)}

    @cached_property
    def _order(self) -> tuple[NodeId, ...]:
        done: dict[NodeId, None] = {}
        left = list(self.nodes)
        while left:
            ready = next((node for node in left if all(one in done for one in node.depends_on)), None)
            if ready is None:
                raise ContractInvalid(because("graph_cycle", nodes=tuple(node.node_id for node in left)), where="nodes")
            done[ready.node_id] = None
            left.remove(ready)
        return tuple(done)

    def node(self, node_id: NodeId) -> Node:
        """Raises UnknownName."""
        found = self._by_id.get(node_id)
        if found is None:
            raise UnknownName(because("node_unknown", node_id=node_id), where="contract")
        return found


class TemplateParameter(Value):
    """One thing the person may choose when starting a mission."""

    name: Name
    type: Annotated[str, msgspec.Meta(pattern="^(place|text|number)$")]
    title: Name
    default: str | float | None = None


class Serves(Value):
    """One kind of clause that a template does: the act, and which parameter takes the place it is about."""

    act: Act
    object: ObjectKind
    parameter: str = ""


class TaskTemplate(Value):
    """A task contract with open places. Strings `${name.field}` are bound by planning; the rest is literal.

    `serves` says for which clauses of a goal it is taken; one without it is started by its name only. `stages` names
    the stage that answers a further act, such as `return`; a default that a goal declines is left out.

    `outcome` is the sentence that a spoken report says of it once all its stages were accepted; what has none cannot be
    reported. `outcomes`, of a template that reports, are sentences for templates that state none, by their names.
    """

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
    serves: tuple[Serves, ...] | msgspec.UnsetType = msgspec.UNSET
    stages: dict[Act, NodeId] | msgspec.UnsetType = msgspec.UNSET
    outcome: Name | msgspec.UnsetType = msgspec.UNSET
    outcomes: dict[Name, Name] | msgspec.UnsetType = msgspec.UNSET


def check(contract: TaskContract, *, rules: RulesVersion = FIRST_RULES, retired: Retired = RETIRED) -> None:
    """Raise ContractInvalid for the first broken rule: names, dependencies, no cycle, required stages, frame.

    Under `rules` also: a retired predicate only for a declared effect, and declared effects that leave something of the
    goal to be verified.
    """
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
    declared = frozenset(name for node in contract.nodes for name in node.declared)
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
        since = retired.get((str(effect.__struct_config__.tag), effect.predicate), rules + 1)
        if since <= rules and condition.condition_id not in declared:
            raise ContractInvalid(
                because("predicate_retired", condition_id=condition.condition_id, predicate=effect.predicate),
                where=where,
            )
    _check_declared(contract)
    _check_covered(contract)


def _check_declared(contract: TaskContract) -> None:
    """A declared effect is a condition of its own node, and not all of the goal rests on declared effects."""
    for node in contract.nodes:
        unknown = sorted(node.declared - {condition.condition_id for condition in node.success_conditions})
        if unknown:
            raise ContractInvalid(
                because(
                    "declared_unknown",
                    node_id=node.node_id,
                    declared=tuple(unknown),
                    names=tuple(one.condition_id for one in node.success_conditions),
                ),
                where=f"nodes.{node.node_id}.evidence.declared",
            )
    declaring = frozenset(node.node_id for node in contract.nodes if node.declared)
    if declaring and all(rests_on(one.effect, declaring) for one in contract.completion_conditions):
        raise ContractInvalid(
            because("nothing_verified", nodes=tuple(sorted(declaring))), where="completion_conditions"
        )


def rests_on(effect: AnyEffect, nodes: frozenset[NodeId]) -> bool:
    """Whether a condition over several stages names one of these."""
    return bool(nodes & set(named_nodes(effect)))


def named_nodes(effect: AnyEffect) -> tuple[NodeId, ...]:
    """What the effect names, nodes among it."""
    match effect:
        case Temporal():
            return effect.nodes
        case Relational():
            return NodeId(effect.subject), NodeId(effect.object)
        case Symbolic():
            return tuple(NodeId(name) for name in effect.arguments.values())
        case Metric() | Visual():
            return ()


def targets_of(node: Node) -> set[Point]:
    """Where a stage's own conditions want the body to be, metres in the contract's frame."""
    return {one.effect.target_m for one in node.success_conditions if isinstance(one.effect, Metric)}


def stages_behind(effect: AnyEffect, nodes: tuple[Node, ...]) -> tuple[Node, ...]:
    """The stages that a completion condition is about: those it names, or those which had to reach its target."""
    if isinstance(effect, Metric):
        return tuple(node for node in nodes if effect.target_m in targets_of(node))
    return tuple(node for node in nodes if node.node_id in named_nodes(effect))


def goal_independence(condition: Condition, nodes: tuple[Node, ...], *, rules: RulesVersion) -> int:
    """The level that a completion condition needs: its own, and that of the stages which had to reach its target."""
    effect = condition.effect
    risks: list[Risk] = ["low"]
    if isinstance(effect, Metric):
        risks += [node.risk for node in stages_behind(effect, nodes)]
    return max(required_independence(rules, risk=risk, required=condition.independence) for risk in risks)


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


def _check_covered(contract: TaskContract) -> None:
    """Every clause that is to be done has a completion condition, and every condition its clause (D42)."""
    reading = contract.reading
    if isinstance(reading, msgspec.UnsetType):
        return
    if (reading.unread or not reading.clauses) and contract.confirmed != reading.digest:
        raise ContractInvalid(because("goal_words_unread"), where="reading")
    numbers = {clause_id(number) for number, _ in enumerate(reading.clauses, start=1)}
    defaults = {f"{PROFILE}.{name}" for name in reading.defaults}
    cited = {condition.clause for condition in contract.completion_conditions}
    if strange := sorted(str(one) for one in cited - numbers - defaults):
        raise ContractInvalid(because("clause_cited_unknown", clause=strange[0]), where="completion_conditions")
    for number, clause in enumerate(reading.clauses, start=1):
        if clause_id(number) not in cited and not declines_default(clause):
            raise ContractInvalid(
                because("clause_untested", number=number, act=clause.act),
                where="completion_conditions",
            )


def declines_default(clause: Clause) -> bool:
    """Whether a clause only leaves out a default of the mission profile: nothing is left to test then."""
    return clause.negated and clause.act in ("return", "report")


def order(contract: TaskContract) -> tuple[NodeId, ...]:
    """Nodes in an order that respects dependencies, ties as declared; raises ContractInvalid on a cycle."""
    return contract._order


def _conditions(contract: TaskContract) -> Iterator[tuple[str, Condition]]:
    for node in contract.nodes:
        for condition in node.success_conditions:
            yield f"nodes.{node.node_id}.success_conditions", condition
    for condition in contract.completion_conditions:
        yield "completion_conditions", condition
