"""A mission's state S_k and the queries on it. Reads no clock, decides nothing. Pure."""

from functools import cached_property
from typing import Literal

import msgspec

from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.configuration import FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.control import Autonomy, stricter
from harness.contracts.effects import Condition, Metric
from harness.contracts.events import DispatchIntended, StopAcknowledged, StopRequested
from harness.contracts.evidence import CommittedFact, DeclaredEffect, EvidencePacket, EvidenceReference
from harness.contracts.models import ModelAdvice
from harness.contracts.proposals import Signature
from harness.contracts.protocol import InvocationStatus
from harness.contracts.reasons import Explanation
from harness.contracts.rules import FIRST_RULES, RulesVersion
from harness.contracts.spoken_goals import SpokenGoal
from harness.contracts.tasks import Node, TaskContract, order, rests_on
from harness.contracts.values import Count, Value
from harness.contracts.verdicts import GoalVerdict, NodeVerdict

MissionStatus = Literal[
    "draft", "compiled", "awaiting_approval", "active", "paused", "awaiting_human", "stopping", "goal_check",
    "succeeded", "partly_verified", "failed", "cancelled", "safe_stopped", "handed_off",
]  # fmt: skip
TERMINAL_MISSION: frozenset[str] = frozenset(
    {"succeeded", "partly_verified", "failed", "cancelled", "safe_stopped", "handed_off"}
)
NodeStatus = Literal[
    "pending", "eligible", "dispatched", "executed", "verifying", "committed", "declared", "rejected", "recovering",
    "escalated", "failed", "superseded",
]  # fmt: skip
SETTLED: frozenset[str] = frozenset({"committed", "declared"})
"""What ends a dependency: accepted, or only declared where the evidence policy says so (D17)."""


class Failure(Value):
    """A failure that C4 has not handled yet."""

    node_id: ids.NodeId
    failure: FailureClass
    reason: Explanation
    at_s: float


class Spend(Value):
    """One authorised step of a ladder."""

    failure: FailureClass
    action: RecoveryAction
    cost: Count
    attempt: Count
    signature: Signature | None
    reason: Explanation


class Invocation(Value):
    """One attempt by one provider. `status` is the supervisor's last durable report."""

    intent: DispatchIntended
    status: InvocationStatus
    handle: str | None = None
    stop_requested: Explanation = ""


class NodeState(Value):
    """One stage: its status, what was tried, and the gate's decision on it.

    `begun_at` is the attempt after which this revision of the graph opened it: the next one needs no recovery step.
    `advice`: what models said about its newest failure.
    """

    node_id: ids.NodeId
    status: NodeStatus = "pending"
    attempt: Count = 0
    provider_id: ids.ProviderId | None = None
    spends: tuple[Spend, ...] = ()
    excluded: tuple[ids.ProviderId, ...] = ()
    failure: Failure | None = None
    failures: tuple[Failure, ...] = ()
    wait_until_s: float | None = None
    give_up_s: float | None = None
    waiting_for: Explanation = ""
    packets: tuple[EvidencePacket, ...] = ()
    verdicts: tuple[NodeVerdict, ...] = ()
    rejections: tuple[str, ...] = ()
    committed_k: Count | None = None
    declared_k: Count | None = None
    begun_at: Count = 0
    aborting: bool = False
    attested: tuple[EvidenceReference, ...] = ()
    advice: tuple[ModelAdvice, ...] = ()

    @property
    def fresh(self) -> bool:
        """Whether nothing was attempted in this revision of the graph."""
        return self.attempt == self.begun_at

    def spent(self, action: RecoveryAction) -> int:
        return sum(spend.cost for spend in self.spends if spend.action == action)

    @property
    def spent_total(self) -> int:
        return sum(spend.cost for spend in self.spends)


class SupersededResult(Value):
    """A stage's result before a revision of the graph reopened it: kept, never decisive any more (D29)."""

    revision: Count
    state: NodeState
    facts: tuple[CommittedFact, ...]


class DisputedFact(Value):
    """An accepted fact that a person disputes, or that depends on one (`root` false). `packet_id`: which acceptance."""

    condition_id: ids.ConditionId
    packet_id: ids.PacketId
    node_id: ids.NodeId
    root: bool
    actor: Actor
    reason: Explanation


class Mission(Value, dict=True, gc=True):
    """S_k: node states, observed and committed facts, evidence references, remaining budgets (R37)."""

    version: Count = 0
    k: Count = 0
    mission_id: ids.MissionId = ids.MissionId("")
    robot_id: ids.RobotId = ids.RobotId("")
    goal: str = ""
    template: str = ""
    requested_by: Actor | None = None
    configuration: ids.Digest = ids.Digest("")
    seed: int = 0
    labels: dict[str, str] = msgspec.field(default_factory=dict)
    autonomy: Autonomy = "autonomous"
    autonomy_limit: Autonomy = "autonomous"
    replay: bool = False
    trial: bool = False
    channel: str | msgspec.UnsetType = msgspec.UNSET
    spoken: SpokenGoal | msgspec.UnsetType = msgspec.UNSET
    status: MissionStatus = "draft"
    contract: TaskContract | None = None
    policy: RecoveryPolicy | None = None
    rules: RulesVersion = FIRST_RULES
    graph_revision: Count = 0
    nodes: dict[ids.NodeId, NodeState] = msgspec.field(default_factory=dict)
    invocation: Invocation | None = None
    facts: tuple[CommittedFact, ...] = ()
    declared: tuple[DeclaredEffect, ...] = ()
    observed: tuple[EvidenceReference, ...] = ()
    vetoes: dict[str, Explanation] = msgspec.field(default_factory=dict)
    handoff_id: ids.HandoffId | None = None
    stop: StopRequested | None = None
    stopped: StopAcknowledged | None = None
    goal_verdict: GoalVerdict | None = None
    relooks: Count = 0
    report: Explanation = ""
    reason: Explanation = ""
    history: tuple[SupersededResult, ...] = ()
    disputes: tuple[DisputedFact, ...] = ()

    @property
    def ended(self) -> bool:
        return self.status in TERMINAL_MISSION

    @property
    def goal_outcome(self) -> str:
        """What is known of the goal: the newest goal verdict, or that it was verified in part only; empty before."""
        if self.status == "partly_verified":
            return self.status
        return self.goal_verdict.verdict if self.goal_verdict else ""

    @property
    def level(self) -> Autonomy:
        """The autonomy level that applies: the stricter of its own level and the site's limit."""
        return stricter(self.autonomy, self.autonomy_limit)

    @property
    def spent_total(self) -> int:
        return self.relooks + sum(node.spent_total for node in self.nodes.values())

    @property
    def false_completions(self) -> int:
        """Acceptances that a person disputed: each counts as false; those that depend on it do not count again."""
        return sum(dispute.root for dispute in self.disputes)

    @property
    def disputed(self) -> tuple[CommittedFact, ...]:
        """Accepted facts that are currently disputed, or that depend on a disputed one."""
        marked = {(dispute.condition_id, dispute.packet_id) for dispute in self.disputes}
        return tuple(fact for fact in self.facts if (fact.condition_id, fact.packet_id) in marked)

    def of(self, node_id: ids.NodeId) -> NodeState:
        return self.nodes[node_id]

    @cached_property
    def _frontier(self) -> tuple[ids.NodeId, ...]:
        contract = required_contract(self)
        return tuple(node_id for node_id in order(contract) if _is_open(self, contract.node(node_id)))


def required_contract(mission: Mission) -> TaskContract:
    """The mission's contract; a mission without one has not been compiled, which is a programming error."""
    if mission.contract is None:
        raise ValueError(f"mission {mission.mission_id} has no contract yet")
    return mission.contract


def pointless_steps(mission: Mission, node_id: ids.NodeId) -> tuple[RecoveryAction, ...]:
    """Steps that cannot change what failed, whatever their ladder says (D49).

    No look brings a body to where it was measured not to be, and no other route frees a resource that somebody holds.
    """
    state = mission.of(node_id)
    if state.failure is not None and state.failure.failure == "resource_conflict":
        return ("local_replan",)
    return ("re_perceive", "adjust_view") if _measured_elsewhere(mission, node_id) else ()


def _measured_elsewhere(mission: Mission, node_id: ids.NodeId) -> bool:
    """Whether the stage failed because the body was measured away from where the stage is to bring it."""
    state = mission.of(node_id)
    if state.failure is None or state.failure.failure != "violated" or not state.verdicts:
        return False
    effects = {one.condition_id: one.effect for one in required_contract(mission).node(node_id).success_conditions}
    refuted = (effects.get(one.condition_id) for one in state.verdicts[-1].results if one.verdict == "violated")
    return any(isinstance(effect, Metric) for effect in refuted)


def required_policy(mission: Mission) -> RecoveryPolicy:
    """The recovery policy the mission is pinned to."""
    if mission.policy is None:
        raise ValueError(f"mission {mission.mission_id} has no contract yet")
    return mission.policy


def eligible(mission: Mission) -> tuple[ids.NodeId, ...]:
    """Nodes that may be dispatched: every dependency settled, not merely finished (R11), in graph order."""
    return mission._frontier


def _is_open(mission: Mission, node: Node) -> bool:
    state = mission.of(node.node_id)
    if state.status not in ("pending", "recovering") or state.failure is not None:
        return False
    before = [mission.of(dependency).status for dependency in node.depends_on]
    if all(status in SETTLED for status in before):
        return True
    salvage = node.runs_after_failure and all(status in (*SETTLED, "failed", "pending") for status in before)
    return salvage and failed(mission)


def failed(mission: Mission) -> bool:
    """Whether a required node has failed for good."""
    contract = required_contract(mission)
    return any(node.required and mission.of(node.node_id).status == "failed" for node in contract.nodes)


def all_required_settled(mission: Mission) -> bool:
    """Whether every required node is committed, or declared where its evidence policy names the effect."""
    contract = required_contract(mission)
    return all(mission.of(node.node_id).status in SETTLED for node in contract.nodes if node.required)


def declared_nodes(mission: Mission) -> frozenset[ids.NodeId]:
    """The stages that ended with an effect which only its provider declares."""
    return frozenset(node_id for node_id, state in mission.nodes.items() if state.status == "declared")


def declared_goals(mission: Mission) -> tuple[Condition, ...]:
    """The completion conditions that name a declared stage: they cannot be verified (D17)."""
    nodes = declared_nodes(mission)
    if not nodes or mission.contract is None:
        return ()
    own = [
        condition.effect
        for node in mission.contract.nodes
        if node.node_id in nodes
        for condition in node.success_conditions
        if condition.condition_id in node.declared
    ]
    return tuple(
        one
        for one in mission.contract.completion_conditions
        if rests_on(one.effect, nodes) or any(one.effect == effect for effect in own)
    )
