"""Compiles C4, the recovery role's view: the failure, the attempts, the remaining budget and the alternatives.

Records, by kind: "failure" (projections.Failure); "node" (FailedNode); "attempts" (list of projections.Spend: every
authorised step with its cost and signature); "budget" (Remaining); "ladder" (LadderState: the pinned policy's steps
for this failure class); "alternative" (CapabilityCard, one per provider that may still serve the node); "verdict"
(NodeVerdict: the last one with its results, whose evidence justifies an escalation); "advice" (ModelAdvice, for people
and models); "observed" (EvidenceReference); "robot" (RobotStatus).
"""

from harness.contexts.recent_observations import observed_references, other_map, robot_status
from harness.contexts.selection import Selection, SelectionItem, compile_context
from harness.contexts.skill import ancestors
from harness.contexts.view import StateView, accepted, configured, referenced
from harness.contracts.capabilities import Capability, CapabilityCard, Risk
from harness.contracts.configuration import SPENDING, FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.reasons import because
from harness.contracts.values import Positive, Share, Value, raw
from harness.projections.mission import Failure, pointless_steps

MOTION: frozenset[Capability] = frozenset({"navigate", "capture_panorama"})
"""The shipped capabilities that move the robot; one that a site declares counts as if it did."""


class FailedNode(Value):
    """The node that failed: whether its skill moves the robot decides how an exhausted budget ends (D26).

    `pointless`: steps that cannot change what failed, whatever the ladder says.
    """

    node_id: NodeId
    capabilities: tuple[Capability, ...]
    risk: Risk
    required: bool
    moves: bool
    attempt: int
    provider_id: ProviderId | None
    excluded: tuple[ProviderId, ...]
    pointless: tuple[RecoveryAction, ...] = ()


class RemainingBudget(Value):
    """What is left of the recovery budgets: per action, of the node's total, of the mission's total (D24)."""

    left: dict[RecoveryAction, int]
    left_node: int
    left_mission: int
    total_node: int
    total_mission: int


class LadderState(Value):
    """The steps of this failure class in order, and the policy's bounds."""

    failure: FailureClass
    rungs: tuple[RecoveryAction, ...]
    approval_share: Share
    wait_s: Positive


def recovery_context(view: StateView, node_id: NodeId, alternatives: tuple[CapabilityCard, ...]) -> Context:
    """C4 of a failed node. Raises ContractInvalid if it has no open failure, ContextOverflow over the budget."""
    state = view.mission.of(node_id)
    if state.failure is None:
        raise ContractInvalid(because("no_failure_to_recover", node_id=node_id), where=view.mission.mission_id)
    items = [
        SelectionItem(accepted("failure", node_id, state.failure, at_s=state.failure.at_s, mandatory=True)),
        SelectionItem(accepted("node", node_id, _failed_node(view, node_id), at_s=view.at_s, mandatory=True)),
        SelectionItem(accepted("attempts", node_id, state.spends, at_s=view.at_s, mandatory=True)),
        SelectionItem(accepted("budget", node_id, _remaining(view, node_id), at_s=view.at_s, mandatory=True)),
        *_ladder(view.recovery, state.failure),
        *(SelectionItem(configured("alternative", card.provider_id, card, at_s=view.at_s)) for card in alternatives),
        *_verdict(view, node_id),
        *_advice(view, node_id),
        *_evidence(view, node_id),
        *observed_references(view),
        *robot_status(view),
    ]
    return compile_context(
        view,
        items,
        selection=Selection(
            role="recovery",
            node_id=node_id,
            budget=view.rules.c4_items,
            minimum_confidence=view.rules.minimum_confidence,
            nodes=ancestors(view.contract, node_id) | {node_id},
        ),
    )


def _failed_node(view: StateView, node_id: NodeId) -> FailedNode:
    node, state = view.node(node_id), view.mission.of(node_id)
    return FailedNode(
        node_id=node_id,
        capabilities=node.capabilities,
        risk=node.risk,
        required=node.required,
        moves=bool(MOTION & set(node.capabilities)) or any("." in name for name in node.capabilities),
        attempt=state.attempt,
        provider_id=state.provider_id,
        excluded=state.excluded,
        pointless=pointless_steps(view.mission, node_id),
    )


def _remaining(view: StateView, node_id: NodeId) -> RemainingBudget:
    limits, state = view.node(node_id).recovery, view.mission.of(node_id)
    return RemainingBudget(
        left={action: max(0, getattr(limits, action) - state.spent(action)) for action in SPENDING},
        left_node=limits.total - state.spent_total,
        left_mission=view.contract.recovery_total - view.mission.spent_total,
        total_node=limits.total,
        total_mission=view.contract.recovery_total,
    )


def _ladder(policy: RecoveryPolicy | None, failure: Failure) -> list[SelectionItem]:
    if policy is None:
        return []
    ladder = LadderState(
        failure=failure.failure,
        rungs=policy.ladders.get(failure.failure, ("human",)),
        approval_share=policy.approval_share,
        wait_s=policy.wait_s,
    )
    return [SelectionItem(configured("ladder", failure.failure, ladder, at_s=failure.at_s, mandatory=True))]


def _verdict(view: StateView, node_id: NodeId) -> list[SelectionItem]:
    verdicts = view.mission.of(node_id).verdicts
    return [SelectionItem(accepted("verdict", node_id, verdicts[-1], at_s=verdicts[-1].at_s))] if verdicts else []


def _advice(view: StateView, node_id: NodeId) -> list[SelectionItem]:
    """What models said about this failure, as proposals; the ladder reads none of it."""
    return [
        SelectionItem(
            ContextRecord(
                kind="advice",
                origin="planner",
                source=advice.use.model,
                at_s=view.at_s,
                value=raw(advice),
            )
        )
        for advice in view.mission.of(node_id).advice
    ]


def _evidence(view: StateView, node_id: NodeId) -> list[SelectionItem]:
    """What this node's packets saw after execution: observations newer than a failure count as new (D25)."""
    items = []
    for packet in view.mission.of(node_id).packets:
        for reference in packet.after:
            record = referenced("observed", reference)
            barred = other_map(view, record, reference.map_version)
            subject = f"{reference.kind}@{reference.frame}"
            items.append(SelectionItem(record, scope=frozenset({node_id}), subject=subject, barred=barred))
    return items
