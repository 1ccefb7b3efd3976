"""Compiles C2, the skill role's view: what it needs to do one subgoal with the selected provider.

Records, by kind: "node" (Node: one subgoal, its typed parameters are the grounded targets); "card" (CapabilityCard);
"attempt" (Attempt: which attempt this would be, and the recovery action that asked for it); "facts" (list of
CommittedFact of everything the node builds on); "declared_effects" (list of DeclaredEffect of the stages before it,
which are no facts); "given_up" (list of subgoals: optional stages that failed); "constraints" (Constraints); "robot"
(RobotStatus); "observation" (a sample); "observed" (EvidenceReference); "example" (verified operational examples, at
most three); "intention" (what a planner proposed: usable here, never evidence).
"""

from msgspec.structs import replace

from harness.contexts.recent_observations import newest_samples, observed_references, robot_status
from harness.contexts.selection import Selection, SelectionItem, budgeted, compile_context
from harness.contexts.view import StateView, accepted, configured, forbidden_m
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.configuration import FailureClass, RecoveryAction
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import NodeId
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Value
from harness.projections.unverified import failed_parts


class SkillAttempt(Value):
    """Which attempt comes next, and what recovery authorised it; no action: the first, free one (D24).

    `heeds_examples`: a repeated motion heeds what worked here. Contexts of older releases do not say so.
    """

    attempt: Count
    action: RecoveryAction | None = None
    failure: FailureClass | None = None
    heeds_examples: bool = True


def skill_context(view: StateView, node_id: NodeId, card: CapabilityCard) -> Context:
    """C2 of one node for the routed provider. Raises ContextOverflow if the mandatory records exceed the budget."""
    scope = ancestors(view.contract, node_id)
    items = [
        SelectionItem(configured("node", node_id, view.node(node_id), at_s=view.at_s, mandatory=True)),
        SelectionItem(configured("card", card.provider_id, card, at_s=view.at_s, mandatory=True)),
        SelectionItem(accepted("attempt", "mission", _attempt(view, node_id), at_s=view.at_s, mandatory=True)),
        *_facts(view, scope),
        *_declared(view, scope),
        *_given_up(view),
        SelectionItem(configured("constraints", "contract", view.contract.constraints, at_s=view.at_s)),
        *_kept_out(view),
        *robot_status(view),
        *newest_samples(view),
        *observed_references(view),
        *(_record_item(record, view) for record in view.proposals),
        *budgeted((_example_item(example) for example in view.examples), limit=view.rules.c2_examples),
    ]
    return compile_context(
        view,
        items,
        selection=Selection(
            role="skill",
            node_id=node_id,
            budget=view.rules.c2_items,
            minimum_confidence=view.rules.minimum_confidence,
            nodes=scope | {node_id},
        ),
    )


def _example_item(example: ContextRecord) -> SelectionItem:
    """An example has its own budget: newer observations do not crowd it out."""
    return SelectionItem(replace(example, mandatory=True))


def ancestors(contract: TaskContract, node_id: NodeId) -> frozenset[NodeId]:
    """Every node that this one builds on, directly or not."""
    found: set[NodeId] = set()
    ahead = list(contract.node(node_id).depends_on)
    while ahead:
        name = ahead.pop()
        if name not in found:
            found.add(name)
            ahead.extend(contract.node(name).depends_on)
    return frozenset(found)


def relevant_facts(view: StateView, node_id: NodeId) -> tuple[CommittedFact, ...]:
    """Committed facts of the nodes that this one builds on."""
    relevant = ancestors(view.contract, node_id)
    return tuple(fact for fact in view.mission.facts if fact.node_id in relevant)


def _facts(view: StateView, scope: frozenset[NodeId]) -> list[SelectionItem]:
    facts = tuple(fact for fact in view.mission.facts if fact.node_id in scope)
    if not facts:
        return []
    return [SelectionItem(accepted("facts", "mission", facts, at_s=max(fact.at_s for fact in facts), mandatory=True))]


def _declared(view: StateView, scope: frozenset[NodeId]) -> list[SelectionItem]:
    """What the stages before it only declared: it may be told on, as declared."""
    effects = tuple(effect for effect in view.mission.declared if effect.node_id in scope)
    if not effects:
        return []
    newest_s = max(effect.at_s for effect in effects)
    return [SelectionItem(accepted("declared_effects", "mission", effects, at_s=newest_s, mandatory=True))]


def _kept_out(view: StateView) -> list[SelectionItem]:
    """The floor that no way may cross, by name, for a provider that plans ways of its own."""
    floors = forbidden_m(view.site, view.contract.constraints.keep_out)
    return [SelectionItem(configured("keep_out", "site", floors, at_s=view.at_s, mandatory=True))] if floors else []


def _given_up(view: StateView) -> list[SelectionItem]:
    """What was to be done and failed without stopping the mission: whoever is told of it is told that too."""
    failed = tuple(one.text for one in failed_parts(view.mission))
    return [SelectionItem(accepted("given_up", "mission", failed, at_s=view.at_s, mandatory=True))] if failed else []


def _attempt(view: StateView, node_id: NodeId) -> SkillAttempt:
    state = view.mission.of(node_id)
    if not state.spends:
        return SkillAttempt(attempt=state.attempt + 1)
    spend = state.spends[-1]
    return SkillAttempt(attempt=state.attempt + 1, action=spend.action, failure=spend.failure)


def _record_item(record: ContextRecord, view: StateView) -> SelectionItem:
    """A proposal names its node in its source where it is about one node only."""
    node_id = NodeId(record.source)
    return SelectionItem(record, scope=frozenset({node_id}) if node_id in view.mission.nodes else frozenset())
