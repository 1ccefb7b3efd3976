"""Compiles C1, the planner's view: goal, open nodes, accepted facts, places, and coarse failures.

Records, by kind: "goal" (Goal); "frontier" (list of FrontierNode, the eligible nodes in graph order); "facts" (list of
CommittedFact, one record per node); "place" (Place) and "map"; "robot" (RobotStatus); "observation" (a sample);
"observed" (EvidenceReference); "failures" (CoarseFailures, one per node: the coarse history); "estimate"
(TargetEstimates, one per estimating provider).
"""

from collections import Counter

from harness.contexts.recent_observations import newest_samples, observed_references, robot_status
from harness.contexts.selection import Selection, SelectionItem, compile_context
from harness.contexts.view import StateView, accepted, configured
from harness.contracts.capabilities import Capability, Risk
from harness.contracts.configuration import FailureClass
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.ids import NodeId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Value, encode, raw
from harness.projections.mission import NodeStatus, eligible


class FrontierNode(Value):
    """One node that may be dispatched now."""

    node_id: NodeId
    subgoal: str
    capabilities: tuple[Capability, ...]
    risk: Risk
    required: bool
    status: NodeStatus
    attempt: int
    waiting_for: Explanation


class CoarseFailures(Value):
    """How often a node failed, by class: enough for planning, nothing to imitate."""

    node_id: NodeId
    failures: dict[FailureClass, int]


def planner_context(view: StateView) -> Context:
    """C1 of one state version. Raises ContextOverflow if the mandatory records exceed the role's budget."""
    items = [
        SelectionItem(goal_record(view)),
        SelectionItem(accepted("frontier", "mission", frontier(view), at_s=view.at_s, mandatory=True)),
        *(SelectionItem(record, scope=frozenset({NodeId(record.source)})) for record in facts_by_node(view)),
        *_places(view),
        *robot_status(view),
        *newest_samples(view),
        *observed_references(view),
        *_failures(view),
        *(SelectionItem(record) for record in view.estimates),
    ]
    return compile_context(
        view,
        items,
        selection=Selection(
            role="planner",
            node_id=None,
            budget=view.rules.c1_items,
            minimum_confidence=view.rules.minimum_confidence,
        ),
    )


def goal_record(view: StateView) -> ContextRecord:
    """The user's own text and its checksum, kind "goal"."""
    requester = view.mission.requested_by
    return ContextRecord(
        kind="goal",
        origin="human",
        source=requester.name if requester else "user",
        at_s=view.at_s,
        value=raw(view.contract.goal),
        mandatory=True,
    )


def frontier(view: StateView) -> tuple[FrontierNode, ...]:
    """The nodes that may be dispatched now, in graph order."""
    return tuple(
        FrontierNode(
            node_id=node_id,
            subgoal=view.node(node_id).subgoal,
            capabilities=view.node(node_id).capabilities,
            risk=view.node(node_id).risk,
            required=view.node(node_id).required,
            status=view.mission.of(node_id).status,
            attempt=view.mission.of(node_id).attempt,
            waiting_for=view.mission.of(node_id).waiting_for,
        )
        for node_id in eligible(view.mission)
    )


def facts_by_node(view: StateView) -> list[ContextRecord]:
    """Committed facts, one record per node, kind "facts", source = the node."""
    nodes = dict.fromkeys(fact.node_id for fact in view.mission.facts)
    return [
        accepted("facts", node_id, facts, at_s=max(fact.at_s for fact in facts))
        for node_id in nodes
        for facts in [tuple(fact for fact in view.mission.facts if fact.node_id == node_id)]
    ]


def _places(view: StateView) -> list[SelectionItem]:
    named = encode(view.contract.bindings)
    targets = {place.approach_m for place in view.site.places if encode(place.place_id) in named}
    places = [place for place in view.site.places if place.approach_m in targets or not targets]
    map_state = {"site": view.site.name, "frame": view.contract.frame, "map_version": view.contract.map_version}
    return [
        SelectionItem(configured("map", view.site.name, map_state, at_s=view.at_s)),
        *(SelectionItem(configured("place", place.place_id, place, at_s=view.at_s)) for place in places),
    ]


def _failures(view: StateView) -> list[SelectionItem]:
    return [
        SelectionItem(
            accepted(
                "failures",
                node_id,
                CoarseFailures(node_id=node_id, failures=dict(Counter(one.failure for one in state.failures))),
                at_s=state.failures[-1].at_s,
            ),
        )
        for node_id, state in view.mission.nodes.items()
        if state.failures
    ]
