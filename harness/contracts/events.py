"""Events of a mission, in the past tense; leases and handoffs have modules of their own.

Events marked (k+1) advance the mission's decision basis when folded (D2).
"""

from typing import Literal

import msgspec

from harness.contracts import ids
from harness.contracts.actors import Actor, Event
from harness.contracts.configuration import FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.control import Autonomy, AutonomySet
from harness.contracts.evidence import CommittedFact, DeclaredEffect, EvidencePacket, EvidenceReference
from harness.contracts.models import ModelAdvice
from harness.contracts.proposals import Signature
from harness.contracts.protocol import InvocationStatus, Parameters
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)
from harness.contracts.rules import FIRST_RULES, RulesVersion
from harness.contracts.spoken_goals import SpokenGoal
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Name
from harness.contracts.verdicts import GoalVerdict, NodeVerdict

# mission: start -----------------------------------------------------------------------------------------------------


class MissionCreated(Event, tag=True):
    """`trial`: the configuration it is pinned to is in canary, so a person approves each motion (D28, D34).

    `channel`: how the request came, such as `page` or `command-line`; an earlier release did not say. `spoken`: the
    recording and transcript of a goal that was spoken.
    """

    mission_id: ids.MissionId
    robot_id: ids.RobotId
    goal: str
    template: Name
    requested_by: Actor
    configuration: ids.Digest
    seed: int
    labels: dict[str, str] = msgspec.field(default_factory=dict)
    autonomy: Autonomy = "autonomous"
    replay: bool = False
    trial: bool = False
    channel: str | msgspec.UnsetType = msgspec.UNSET
    spoken: SpokenGoal | msgspec.UnsetType = msgspec.UNSET


class ContractCompiled(Event, tag=True, omit_defaults=True):
    """From here on the mission is pinned to its configuration (D35), and to the rules it is judged by (D57)."""

    contract: TaskContract
    contract_digest: ids.Digest
    policy: RecoveryPolicy
    rules: RulesVersion = FIRST_RULES


class ContractRecompiled(Event, tag=True, omit_defaults=True):
    """(k+1) Another configuration became current before the mission was active: compiled and pinned again (D35).

    Whatever was approved for the contract it `replaces` is void.
    """

    configuration: ids.Digest
    replaces: ids.Digest
    contract: TaskContract
    contract_digest: ids.Digest
    policy: RecoveryPolicy
    trial: bool = False
    rules: RulesVersion = FIRST_RULES


class MissionActivated(Event, tag=True):
    pass


# mission: agent loop ------------------------------------------------------------------------------------------------


class NodePlanned(Event, tag=True):
    """C1 chose a node and routing a provider; context, candidate set and the planner's proposal are records.

    `refused`: why the planner's proposal was refused; the harness then used its own plan (R41).
    """

    node_id: ids.NodeId
    provider_id: ids.ProviderId
    context: ids.Digest
    candidates: ids.Digest
    reason: Explanation
    planner: Name = "graph-order-1"
    proposal: ids.Digest | None = None
    refused: Explanation = ""


class ModelAdvised(Event, tag=True):
    """A model was asked about this mission; what it said has no authority, followed or not (R48)."""

    advice: ModelAdvice


class DispatchIntended(Event, tag=True):
    """Recorded, with its leases, before the robot moves (D9). `k_ctx` is k after this transaction's spend.

    `question` and `candidates` are the records of routing's input and output. `aborting`: it runs because a required
    stage failed, and will not count as its own stage (D26). `not_before_s`: a person approved it for then, and it is
    sent no earlier.
    """

    node_id: ids.NodeId
    attempt: Count
    request_id: ids.RequestId
    invocation_id: ids.InvocationId
    provider_id: ids.ProviderId
    provider_version: Name
    capability: Name
    parameters: Parameters
    resources: dict[str, int]
    k_ctx: Count
    deadline_s: float
    dispatched_s: float
    context: ids.Digest
    before: tuple[EvidenceReference, ...] = ()
    blobs: tuple[ids.Digest, ...] = ()
    verify_only: bool = False
    cites: tuple[ids.PacketId, ...] = ()
    action: RecoveryAction | None = None
    handoff_id: ids.HandoffId | None = None
    moves: bool = False
    question: ids.Digest | None = None
    candidates: ids.Digest | None = None
    aborting: bool = False
    not_before_s: float | None = None


class InvocationAccepted(Event, tag=True):
    """Only for providers that are reattached by handle, not by request id (R88)."""

    invocation_id: ids.InvocationId
    handle: Name


class InvocationStopRequested(Event, tag=True):
    invocation_id: ids.InvocationId
    reason: Explanation


class InvocationResumed(Event, tag=True):
    """A restarted supervisor continues the same invocation (D12)."""

    invocation_id: ids.InvocationId


class InvocationEnded(Event, tag=True):
    """The execution ended without a packet to judge: it never started, was stopped, or its outcome is unknown."""

    invocation_id: ids.InvocationId
    status: InvocationStatus
    failure: str
    reason: Explanation


class PreconditionRefused(Event, tag=True):
    """A precondition did not hold at dispatch; the node waits until `give_up_s` (R18)."""

    node_id: ids.NodeId
    precondition: Name
    reason: Explanation
    give_up_s: float


class PacketRetained(Event, tag=True):
    packet: EvidencePacket


class VerdictRecorded(Event, tag=True):
    invocation_id: ids.InvocationId
    verdict: NodeVerdict


class NodeCommitted(Event, tag=True):
    """(k+1) The gate accepted: node advance and facts are one transition (R113).

    `aborting`: accepted as an abort-return, which never counts as the stage (D26).
    """

    node_id: ids.NodeId
    invocation_id: ids.InvocationId
    packet_id: ids.PacketId
    facts: tuple[CommittedFact, ...]
    withdrawn: tuple[ids.ConditionId, ...] = ()
    aborting: bool = False


class EffectDeclared(Event, tag=True):
    """(k+1) The stage ended DECLARED: effects that its evidence policy names rest on its provider's word alone (D17).

    Nothing of it becomes a committed fact. Dependencies count it as ended; conditions do not. `withdrawn` and
    `aborting` as in NodeCommitted.
    """

    node_id: ids.NodeId
    invocation_id: ids.InvocationId
    packet_id: ids.PacketId
    effects: tuple[DeclaredEffect, ...]
    withdrawn: tuple[ids.ConditionId, ...] = ()
    aborting: bool = False


class CommitRejected(Event, tag=True):
    """(k+1) The gate refused; `rule` is the name of the first rule that was broken."""

    node_id: ids.NodeId
    invocation_id: ids.InvocationId
    packet_id: ids.PacketId
    rule: Name
    reason: Reason


class ObservationRecorded(Event, tag=True):
    """A referenced observation; (k+1) only if it contradicts a committed fact or bound precondition."""

    node_id: ids.NodeId | None
    reference: EvidenceReference
    contradicts: tuple[ids.ConditionId, ...] = ()


class EpochChanged(Event, tag=True):
    """(k+1) The map or localisation epoch changed."""

    map_version: Name
    reason: Explanation


class VetoRaised(Event, tag=True):
    """(k+1) A restriction. Only the layer that raised it clears it (D16)."""

    layer: Name
    reason: Explanation


class VetoCleared(Event, tag=True):
    """(k+1)"""

    layer: Name
    reason: Explanation


# mission: recovery --------------------------------------------------------------------------------------------------


class FailureClassified(Event, tag=True):
    """The input of C4: the failure class, the current step of the ladder, what was tried and what is left (R128)."""

    node_id: ids.NodeId
    invocation_id: ids.InvocationId | None
    failure: FailureClass
    reason: Explanation
    at_s: float


class RecoveryAuthorised(Event, tag=True):
    """(k+1 if it costs) One recovery step. `left_node` and `left_mission` are the total budgets after it.

    `handoff_id`: a person chose it there, whatever C4 proposed.
    """

    node_id: ids.NodeId
    failure: FailureClass
    action: RecoveryAction
    cost: Count
    attempt: Count
    signature: Signature | None
    excluded: tuple[ids.ProviderId, ...]
    context: ids.Digest
    reason: Explanation
    until_s: float | None = None
    left_node: Count | None = None
    left_mission: Count | None = None
    handoff_id: ids.HandoffId | None = None


class NodeFailed(Event, tag=True):
    """The node failed for good. `context` is the C4 that led to it."""

    node_id: ids.NodeId
    reason: Explanation
    context: ids.Digest | None = None


# mission: people and ends -------------------------------------------------------------------------------------------


class HandoffRequested(Event, tag=True):
    """The mission waits for a person; the handoff has its own stream. `context` is the C4 that led to it."""

    handoff_id: ids.HandoffId
    node_id: ids.NodeId
    failure: FailureClass
    reason: Explanation
    context: ids.Digest | None = None


class HandoffAnswered(Event, tag=True):
    """(k+1 for an approval or a hand-back) The person's decision, as the mission sees it."""

    handoff_id: ids.HandoffId
    decision: Literal["approved", "rejected", "expired", "superseded", "attested", "handed_back", "closed"]
    actor: Actor
    reason: Explanation


class OperatorRetryGranted(Event, tag=True):
    """(k+1) One further attempt outside the budget, authorised by a person (D1)."""

    node_id: ids.NodeId
    attempt: Count
    action: RecoveryAction
    provider_id: ids.ProviderId | None
    handoff_id: ids.HandoffId


class MissionPaused(Event, tag=True):
    actor: Actor
    reason: Explanation


class MissionResumed(Event, tag=True):
    actor: Actor
    reason: str


class StopRequested(Event, tag=True):
    """A person or policy requested a stop: STOPPING until acknowledged, then at standstill."""

    actor: Actor
    reason: Explanation


class StopAcknowledged(Event, tag=True):
    """The provider acknowledged and the body is static by a source outside the localiser (D15)."""

    static: bool
    measured: dict[str, float]
    reason: Explanation


class GoalVerified(Event, tag=True):
    """The original completion conditions were tested again, as first stored (R118).

    (k+1 if `relook`) An ambiguous goal earns one more look, paid from the mission's total (D29).
    """

    verdict: GoalVerdict
    relook: bool = False


class MissionEnded(Event, tag=True):
    status: Literal["succeeded", "partly_verified", "failed", "cancelled", "safe_stopped", "handed_off"]
    reason: Explanation


class CompletionReported(Event, tag=True):
    """The success report to the user: only after a satisfied goal verdict (R119)."""

    text: Explanation


class PartialCompletionReported(Event, tag=True):
    """No completion report: what was verified of the goal, and by name what was only declared (D17)."""

    text: Explanation


class FailureReported(Event, tag=True):
    """Not a completion report: different text, different type (R120)."""

    text: Explanation


MissionEvent = (
    MissionCreated
    | ContractCompiled
    | ContractRecompiled
    | MissionActivated
    | NodePlanned
    | ModelAdvised
    | DispatchIntended
    | InvocationAccepted
    | InvocationStopRequested
    | InvocationResumed
    | InvocationEnded
    | PreconditionRefused
    | PacketRetained
    | VerdictRecorded
    | NodeCommitted
    | EffectDeclared
    | CommitRejected
    | ObservationRecorded
    | EpochChanged
    | VetoRaised
    | VetoCleared
    | FailureClassified
    | RecoveryAuthorised
    | NodeFailed
    | GraphRevised
    | ConstraintsTightened
    | HandoffRequested
    | HandoffAnswered
    | OperatorRetryGranted
    | AttestationRecorded
    | CompletionDisputed
    | AutonomySet
    | MissionPaused
    | MissionResumed
    | StopRequested
    | StopAcknowledged
    | GoalVerified
    | MissionEnded
    | CompletionReported
    | PartialCompletionReported
    | FailureReported
)
