"""Pure: what a mission is now, folded from its events. Reads no clock, decides nothing."""

from typing import Literal, assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.configuration import FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.events import (
    Autonomy,
    CommitRejected,
    CompletionReported,
    ContractCompiled,
    DispatchIntended,
    EpochChanged,
    FailureClassified,
    FailureReported,
    GoalVerified,
    HandoffAnswered,
    HandoffRequested,
    InvocationAccepted,
    InvocationEnded,
    InvocationResumed,
    InvocationStopRequested,
    MissionActivated,
    MissionCreated,
    MissionEnded,
    MissionEvent,
    MissionPaused,
    MissionResumed,
    NodeCommitted,
    NodeFailed,
    NodePlanned,
    ObservationRecorded,
    OperatorRetryGranted,
    PacketRetained,
    PreconditionRefused,
    RecoveryAuthorised,
    StopAcknowledged,
    StopRequested,
    VerdictRecorded,
    VetoCleared,
    VetoRaised,
)
from harness.contracts.evidence import CommittedFact, EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, HandoffId, MissionId, NodeId, ProviderId, RobotId
from harness.contracts.proposals import Signature
from harness.contracts.protocol import InvocationStatus
from harness.contracts.tasks import TaskContract, order
from harness.contracts.values import Count, Value
from harness.contracts.verdicts import GoalVerdict, NodeVerdict

MissionStatus = Literal[
    "draft", "compiled", "awaiting_approval", "active", "paused", "awaiting_human", "stopping", "goal_check",
    "succeeded", "failed", "cancelled", "safe_stopped", "handed_off",
]  # fmt: skip
TERMINAL_MISSION: frozenset[str] = frozenset({"succeeded", "failed", "cancelled", "safe_stopped", "handed_off"})
NodeStatus = Literal[
    "pending", "eligible", "dispatched", "executed", "verifying", "committed", "rejected", "recovering", "escalated",
    "failed", "superseded",
]  # fmt: skip


class Failure(Value):
    """A failure that C4 has not answered yet."""

    node_id: NodeId
    failure: FailureClass
    reason: str
    at_s: float


class Spend(Value):
    """One authorised rung of a ladder."""

    failure: FailureClass
    action: RecoveryAction
    cost: Count
    attempt: Count
    signature: Signature | None
    reason: str


class Invocation(Value):
    """One attempt by one provider. `status` is the supervisor's last durable word."""

    intent: DispatchIntended
    status: InvocationStatus
    handle: str | None = None
    stop_requested: str = ""


class NodeState(Value):
    """One stage: where it stands, what was tried, and what the gate made of it."""

    node_id: NodeId
    status: NodeStatus = "pending"
    attempt: Count = 0
    provider_id: ProviderId | None = None
    spends: tuple[Spend, ...] = ()
    excluded: tuple[ProviderId, ...] = ()
    failure: Failure | None = None
    failures: tuple[Failure, ...] = ()
    wait_until_s: float | None = None
    give_up_s: float | None = None
    waiting_for: str = ""
    packets: tuple[EvidencePacket, ...] = ()
    verdicts: tuple[NodeVerdict, ...] = ()
    rejections: tuple[str, ...] = ()
    committed_k: Count | None = None

    def spent(self, action: RecoveryAction) -> int:
        return sum(spend.cost for spend in self.spends if spend.action == action)

    @property
    def spent_total(self) -> int:
        return sum(spend.cost for spend in self.spends)


class Mission(Value):
    """S_k: node states, observed and committed facts, evidence references, remaining budgets (R37)."""

    version: Count = 0
    k: Count = 0
    mission_id: MissionId = MissionId("")
    robot_id: RobotId = RobotId("")
    goal: str = ""
    template: str = ""
    requested_by: Actor | None = None
    configuration: Digest = Digest("")
    seed: int = 0
    labels: dict[str, str] = msgspec.field(default_factory=dict)
    autonomy: Autonomy = "autonomous"
    replay: bool = False
    status: MissionStatus = "draft"
    contract: TaskContract | None = None
    policy: RecoveryPolicy | None = None
    graph_revision: Count = 0
    nodes: dict[NodeId, NodeState] = msgspec.field(default_factory=dict)
    invocation: Invocation | None = None
    facts: tuple[CommittedFact, ...] = ()
    observed: tuple[EvidenceReference, ...] = ()
    vetoes: dict[str, str] = msgspec.field(default_factory=dict)
    handoff_id: HandoffId | None = None
    stop: StopRequested | None = None
    stopped: StopAcknowledged | None = None
    goal_verdict: GoalVerdict | None = None
    relooks: Count = 0
    report: str = ""
    reason: str = ""

    @property
    def ended(self) -> bool:
        return self.status in TERMINAL_MISSION

    @property
    def spent_total(self) -> int:
        return self.relooks + sum(node.spent_total for node in self.nodes.values())

    def of(self, node_id: NodeId) -> NodeState:
        return self.nodes[node_id]


def required_contract(mission: Mission) -> TaskContract:
    """The mission's contract; a mission without one has not been compiled, which is a programming error."""
    if mission.contract is None:
        raise ValueError(f"mission {mission.mission_id} has no contract yet")
    return mission.contract


def required_policy(mission: Mission) -> RecoveryPolicy:
    """The recovery policy the mission is pinned to."""
    if mission.policy is None:
        raise ValueError(f"mission {mission.mission_id} has no contract yet")
    return mission.policy


def eligible(mission: Mission) -> tuple[NodeId, ...]:
    """Nodes that may be dispatched: every dependency committed, not merely finished (R11), in graph order."""
    contract = required_contract(mission)
    ready = []
    for node_id in order(contract):
        node, state = contract.node(node_id), mission.of(node_id)
        settled = all(mission.of(dependency).status == "committed" for dependency in node.depends_on)
        salvage = node.runs_after_failure and all(
            mission.of(dependency).status in ("committed", "failed", "pending") for dependency in node.depends_on
        )
        open_to_start = state.status in ("pending", "recovering") and state.failure is None
        if open_to_start and (settled or (salvage and failed(mission))):
            ready.append(node_id)
    return tuple(ready)


def failed(mission: Mission) -> bool:
    """Whether a required node has failed for good."""
    contract = required_contract(mission)
    return any(node.required and mission.of(node.node_id).status == "failed" for node in contract.nodes)


def all_required_committed(mission: Mission) -> bool:
    contract = required_contract(mission)
    return all(mission.of(node.node_id).status == "committed" for node in contract.nodes if node.required)


def apply(mission: Mission, event: MissionEvent) -> Mission:
    """The mission after one more event."""
    return _folded(replace(mission, version=mission.version + 1), event)


def _folded(m: Mission, event: MissionEvent) -> Mission:
    match event:
        case MissionCreated():
            return _created(m, event)
        case ContractCompiled():
            nodes = {node.node_id: NodeState(node_id=node.node_id) for node in event.contract.nodes}
            return replace(m, contract=event.contract, policy=event.policy, status="compiled", nodes=nodes)
        case MissionActivated():
            return replace(m, status="active")
        case NodePlanned():
            return _node(m, event.node_id, provider_id=event.provider_id)
        case DispatchIntended():
            return _dispatched(m, event)
        case InvocationAccepted() | InvocationStopRequested() | InvocationResumed() | InvocationEnded():
            return _invocation(m, event)
        case PreconditionRefused():
            return _node(m, event.node_id, give_up_s=event.give_up_s, waiting_for=event.reason)
        case PacketRetained():
            return _retained(m, event.packet)
        case VerdictRecorded():
            owner = next((node for node in m.nodes.values() if _judged(node, event)), None)
            return _node(m, owner.node_id, verdicts=(*owner.verdicts, event.verdict)) if owner else m
        case NodeCommitted():
            kept = tuple(fact for fact in m.facts if fact.condition_id not in event.withdrawn)
            done = _node(m, event.node_id, status="committed", committed_k=m.k + 1, failure=None, waiting_for="")
            return replace(done, k=m.k + 1, facts=kept + event.facts)
        case CommitRejected():
            return _rejected(replace(m, k=m.k + 1), event)
        case ObservationRecorded():
            contradicted = 1 if event.contradicts else 0
            return replace(m, observed=(*m.observed, event.reference), k=m.k + contradicted)
        case EpochChanged():
            return replace(m, k=m.k + 1)
        case VetoRaised():
            return replace(m, k=m.k + 1, vetoes=m.vetoes | {event.layer: event.reason})
        case VetoCleared():
            return replace(m, k=m.k + 1, vetoes={layer: why for layer, why in m.vetoes.items() if layer != event.layer})
        case FailureClassified():
            node = m.of(event.node_id)
            failure = Failure(node_id=event.node_id, failure=event.failure, reason=event.reason, at_s=event.at_s)
            return _node(m, event.node_id, status="recovering", failure=failure, failures=(*node.failures, failure))
        case RecoveryAuthorised():
            return _recovered(m, event)
        case NodeFailed():
            return _node(m, event.node_id, status="failed", failure=None)
        case HandoffRequested():
            asked = _node(m, event.node_id, status="escalated")
            return replace(asked, status="awaiting_human", handoff_id=event.handoff_id, reason=event.reason)
        case HandoffAnswered():
            status: MissionStatus = "active" if event.decision == "approved" else m.status
            k = m.k + 1 if event.decision == "approved" else m.k
            return replace(m, handoff_id=None, status=status, k=k, reason=event.reason)
        case OperatorRetryGranted():
            return replace(_node(m, event.node_id, status="recovering", failure=None), k=m.k + 1)
        case MissionPaused():
            return replace(m, status="paused", reason=event.reason)
        case MissionResumed():
            return replace(m, status="active", reason="")
        case StopRequested():
            return replace(m, status="stopping", stop=event, reason=event.reason)
        case StopAcknowledged():
            return replace(m, stopped=event)
        case GoalVerified():
            again = 1 if event.relook else 0
            return replace(m, goal_verdict=event.verdict, status="goal_check", relooks=m.relooks + again, k=m.k + again)
        case MissionEnded():
            return replace(m, status=event.status, reason=event.reason, invocation=None)
        case CompletionReported() | FailureReported():
            return replace(m, report=event.text)
        case _:
            assert_never(event)


def _created(m: Mission, event: MissionCreated) -> Mission:
    return replace(
        m,
        mission_id=event.mission_id,
        robot_id=event.robot_id,
        goal=event.goal,
        template=event.template,
        requested_by=event.requested_by,
        configuration=event.configuration,
        seed=event.seed,
        labels=event.labels,
        autonomy=event.autonomy,
        replay=event.replay,
    )


def _dispatched(m: Mission, event: DispatchIntended) -> Mission:
    started = _node(
        m,
        event.node_id,
        status="dispatched",
        attempt=event.attempt,
        provider_id=m.of(event.node_id).provider_id if event.verify_only else event.provider_id,
        failure=None,
        wait_until_s=None,
        waiting_for="",
    )
    return replace(started, invocation=Invocation(intent=event, status="accepted"))


def _invocation(
    m: Mission, event: InvocationAccepted | InvocationStopRequested | InvocationResumed | InvocationEnded
) -> Mission:
    invocation = m.invocation
    if invocation is None:
        return m
    match event:
        case InvocationAccepted():
            return replace(m, invocation=replace(invocation, handle=event.handle))
        case InvocationStopRequested():
            return replace(m, invocation=replace(invocation, status="stopping", stop_requested=event.reason))
        case InvocationResumed():
            return replace(m, invocation=replace(invocation, status="running"))
        case InvocationEnded(status="outcome_unknown"):
            return replace(m, invocation=replace(invocation, status="outcome_unknown"))
        case InvocationEnded():
            return replace(_node(m, invocation.intent.node_id, status="executed"), invocation=None)
        case _:
            assert_never(event)


def _retained(m: Mission, packet: EvidencePacket) -> Mission:
    """A packet of another execution stays in the log and touches no node."""
    if m.invocation is None or m.invocation.intent.invocation_id != packet.identity.invocation_id:
        return m
    node = m.of(m.invocation.intent.node_id)
    kept = _node(m, node.node_id, status="verifying", packets=(*node.packets, packet))
    return replace(kept, invocation=None)


def _judged(node: NodeState, event: VerdictRecorded) -> bool:
    packet = node.packets[-1] if node.packets else None
    return packet is not None and packet.identity.invocation_id == event.invocation_id


def _rejected(m: Mission, event: CommitRejected) -> Mission:
    node = m.nodes.get(event.node_id)
    if node is None or node.status != "verifying":
        return m
    return _node(m, node.node_id, status="rejected", rejections=(*node.rejections, event.rule))


def _recovered(m: Mission, event: RecoveryAuthorised) -> Mission:
    node = m.of(event.node_id)
    spend = Spend(
        failure=event.failure,
        action=event.action,
        cost=event.cost,
        attempt=event.attempt,
        signature=event.signature,
        reason=event.reason,
    )
    paid = _node(
        m,
        event.node_id,
        status="recovering",
        failure=None,
        spends=(*node.spends, spend),
        excluded=event.excluded,
        wait_until_s=event.until_s,
    )
    return replace(paid, k=m.k + event.cost)


def _node(m: Mission, node_id: NodeId, **changes: object) -> Mission:
    return replace(m, nodes=m.nodes | {node_id: replace(m.nodes[node_id], **changes)})
