"""Commands that the gate decides, in the imperative: plain data without any logic."""

from typing import Literal

import msgspec

from harness.contracts.actors import Actor, Command
from harness.contracts.alert_commands import AlertCommand
from harness.contracts.capabilities import Risk
from harness.contracts.configuration import FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.control import Autonomy, ControlCommand, SetAutonomy
from harness.contracts.events import DispatchIntended, NodePlanned
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.handoff_commands import HandoffTurn
from harness.contracts.handoff_events import NoAnswer, ProposedAction, Snapshot
from harness.contracts.ids import (
    ConditionId,
    Digest,
    HandoffId,
    InvocationId,
    MissionId,
    NodeId,
    ResourceId,
    RobotId,
)
from harness.contracts.maps import AttachCloud
from harness.contracts.place_events import PlaceCommand
from harness.contracts.places import Otherwise
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.protocol import InvocationStatus
from harness.contracts.reasons import Explanation
from harness.contracts.revision_commands import (
    DisputeCompletion,
    RecordAttestation,
    ReviseContract,
    TightenConstraints,
    WithdrawMission,
)
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Name
from harness.contracts.verdicts import GoalVerdict, NodeVerdict


class CreateMission(Command, tag=True):
    mission_id: MissionId
    robot_id: RobotId
    goal: Name
    template: Name
    requested_by: Actor
    configuration: Digest
    contract: TaskContract
    policy: RecoveryPolicy
    seed: int = 0
    labels: dict[str, str] = msgspec.field(default_factory=dict)
    autonomy: Autonomy = "autonomous"
    replay: bool = False
    trial: bool = False


class RecompileContract(Command, tag=True):
    """Compile the goal again under the current configuration; allowed only before the mission is active (D35)."""

    configuration: Digest
    contract: TaskContract
    policy: RecoveryPolicy
    trial: bool = False


class ActivateMission(Command, tag=True):
    pass


class AuthoriseDispatch(Command, tag=True):
    """Authorise one invocation, with what pays for it.

    `recovery` pays for it in the same transaction, or `approval` by a person. An `attestation` opens one look without
    motion, free (D17). `handed_back`: the approval is a hand-back and opens such a look.
    """

    intent: DispatchIntended
    planned: NodePlanned | None = None
    recovery: RecoveryProposal | None = None
    signature: Signature | None = None
    recovery_context: Digest | None = None
    approval: HandoffId | None = None
    approver: Actor | None = None
    attestation: RecordAttestation | None = None
    handed_back: bool = False
    reason: Explanation = ""


class RefusePrecondition(Command, tag=True):
    node_id: NodeId
    precondition: Name
    reason: Explanation
    at_s: float


class AcceptInvocation(Command, tag=True):
    invocation_id: InvocationId
    handle: Name


class StopInvocation(Command, tag=True):
    """Stop an invocation on the supervisor's behalf: a deadline, a recovery step or a person's stop."""

    invocation_id: InvocationId
    reason: Explanation
    recovery: RecoveryProposal | None = None
    recovery_context: Digest | None = None


class ResumeInvocation(Command, tag=True):
    invocation_id: InvocationId


class EndInvocation(Command, tag=True):
    """End an invocation without a packet: the request never arrived, or the outcome is unknown."""

    invocation_id: InvocationId
    status: InvocationStatus
    failure: str
    reason: Explanation
    at_s: float


class CompleteNode(Command, tag=True):
    """Complete a node; the only command that can lead to a committed fact."""

    packet: EvidencePacket
    verdict: NodeVerdict


class ReportFailure(Command, tag=True):
    """Report a failure without a packet: no provider, no lease, a precondition that never held, or a timeout."""

    node_id: NodeId
    invocation_id: InvocationId | None
    failure: FailureClass
    reason: Explanation
    at_s: float


class AuthoriseWait(Command, tag=True):
    """Authorise a free recovery step: wait, reattach or verify again until `until_s`."""

    node_id: NodeId
    proposal: RecoveryProposal
    context: Digest
    until_s: float


class FailNode(Command, tag=True):
    node_id: NodeId
    reason: Explanation
    context: Digest | None = None


class AskPerson(Command, tag=True):
    handoff_id: HandoffId
    node_id: NodeId
    failure: FailureClass
    reason: Explanation
    context: Digest | None = None


class AnswerMission(Command, tag=True):
    """Apply a handoff's decision to the mission; approvals use AuthoriseDispatch instead."""

    handoff_id: HandoffId
    decision: Literal["rejected", "expired", "superseded", "closed"]
    actor: Actor
    reason: Explanation


class PauseMission(Command, tag=True):
    actor: Actor
    reason: Name


class ResumeMission(Command, tag=True):
    actor: Actor
    reason: Name


class StopMission(Command, tag=True):
    actor: Actor
    reason: Explanation


class AcknowledgeStop(Command, tag=True):
    static: bool
    measured: dict[str, float]
    reason: Explanation


class JudgeGoal(Command, tag=True):
    verdict: GoalVerdict


class EndMission(Command, tag=True):
    """End a mission without success; success comes only from JudgeGoal."""

    status: Literal["failed", "cancelled", "safe_stopped", "handed_off"]
    reason: Explanation


class RecordObservation(Command, tag=True):
    node_id: NodeId | None
    reference: EvidenceReference
    contradicts: tuple[ConditionId, ...] = ()


class ChangeEpoch(Command, tag=True):
    map_version: Name
    reason: Explanation


class RaiseVeto(Command, tag=True):
    layer: Name
    reason: Explanation


class ClearVeto(Command, tag=True):
    layer: Name
    reason: Explanation


MissionCommand = (
    CreateMission
    | RecompileContract
    | ActivateMission
    | AuthoriseDispatch
    | RefusePrecondition
    | AcceptInvocation
    | StopInvocation
    | ResumeInvocation
    | EndInvocation
    | CompleteNode
    | ReportFailure
    | AuthoriseWait
    | FailNode
    | ReviseContract
    | TightenConstraints
    | AskPerson
    | DisputeCompletion
    | AnswerMission
    | SetAutonomy
    | PauseMission
    | ResumeMission
    | StopMission
    | WithdrawMission
    | AcknowledgeStop
    | JudgeGoal
    | EndMission
    | RecordObservation
    | ChangeEpoch
    | RaiseVeto
    | ClearVeto
)


class AcquireLease(Command, tag=True):
    resource: ResourceId
    mission_id: MissionId
    invocation_id: InvocationId
    token: Count
    expires_s: float


class ReleaseLease(Command, tag=True):
    """Release a lease, only while its holder is at standstill.

    `static` is the displacement measured by a source outside the localiser.
    """

    invocation_id: InvocationId
    reason: Explanation


class QuarantineLease(Command, tag=True):
    invocation_id: InvocationId
    reason: Explanation


class FreeLease(Command, tag=True):
    actor: Actor
    static: dict[str, float]
    reason: Explanation


LeaseCommand = AcquireLease | ReleaseLease | QuarantineLease | FreeLease


class OpenHandoff(Command, tag=True):
    handoff_id: HandoffId
    mission_id: MissionId
    robot_id: RobotId
    node_id: NodeId
    k: Count
    failure: FailureClass
    reason: Explanation
    risk: Risk
    proposal: ProposedAction | None
    snapshot: Snapshot
    evidence: Digest
    no_answer: NoAnswer
    deadline_at_s: float
    limit_at_s: float | None = None
    choices: tuple[RecoveryAction, ...] = ()
    safe_place: str = ""
    otherwise: Otherwise | Literal[""] = ""


class RefreshHandoff(Command, tag=True):
    k: Count
    proposal: ProposedAction | None
    snapshot: Snapshot
    evidence: Digest
    choices: tuple[RecoveryAction, ...] = ()
    actor: Actor | None = None


class ApproveHandoff(Command, tag=True):
    """Approve a handoff. `subject` and `evidence` are what the person saw, `shown` the page that showed it.

    The harness adds the current state: the state version `k` and `fresh`, a new observation of the robot. Without them
    the command is refused (D28).
    """

    actor: Actor
    reason: Name
    key: Name
    cycle: Count
    subject: Digest
    evidence: Digest
    k: Count | None = None
    fresh: Snapshot | None = None
    shown: Digest | None = None
    claim: str = ""


class RejectHandoff(Command, tag=True):
    actor: Actor
    reason: Name
    key: Name
    cycle: Count
    subject: Digest
    claim: str = ""


class AttestHandoff(Command, tag=True):
    """Attest one condition from a person's own observation, on the question as it was shown in this cycle."""

    actor: Actor
    reason: str
    key: Name
    cycle: Count
    condition_id: ConditionId
    claim: str = ""


class ExpireHandoff(Command, tag=True):
    pass


class SupersedeHandoff(Command, tag=True):
    reason: Explanation


class MarkDispatched(Command, tag=True):
    """Mark an invocation as about to be sent. `actor` is the person who authorised it; their role is checked again."""

    invocation_id: InvocationId
    actor: Actor | None = None


class RecordEffect(Command, tag=True):
    outcome: Literal["confirmed", "failed", "unknown"]
    reason: Explanation


HandoffCommand = (
    OpenHandoff
    | RefreshHandoff
    | ApproveHandoff
    | RejectHandoff
    | AttestHandoff
    | ExpireHandoff
    | SupersedeHandoff
    | MarkDispatched
    | RecordEffect
    | HandoffTurn
)


AnyCommand = MissionCommand | LeaseCommand | HandoffCommand | ControlCommand | AttachCloud | AlertCommand | PlaceCommand
