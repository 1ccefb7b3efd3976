"""What is asked of the gate, in the imperative. Data: asking is not deciding."""

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
    """The goal compiled under the configuration that is current now; only before the mission is active (D35)."""

    configuration: Digest
    contract: TaskContract
    policy: RecoveryPolicy
    trial: bool = False


class ActivateMission(Command, tag=True):
    pass


class AuthoriseDispatch(Command, tag=True):
    """One invocation. `recovery` pays for it in the same transaction, or `approval` by a person, or an `attestation`
    opens it: one look without motion, free (D17). `handed_back`: the approval is a hand-back and opens such a look."""

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
    """The supervisor's stop: a deadline, a ladder's rung or a person's stop."""

    invocation_id: InvocationId
    reason: Explanation
    recovery: RecoveryProposal | None = None
    recovery_context: Digest | None = None


class ResumeInvocation(Command, tag=True):
    invocation_id: InvocationId


class EndInvocation(Command, tag=True):
    """No packet can be made: the request never arrived, or the outcome is unknown."""

    invocation_id: InvocationId
    status: InvocationStatus
    failure: str
    reason: Explanation
    at_s: float


class CompleteNode(Command, tag=True):
    """The only command that can lead to a committed fact."""

    packet: EvidencePacket
    verdict: NodeVerdict


class ReportFailure(Command, tag=True):
    """A failure that has no packet: no provider, no lease, a precondition that never came true, a timeout."""

    node_id: NodeId
    invocation_id: InvocationId | None
    failure: FailureClass
    reason: Explanation
    at_s: float


class AuthoriseWait(Command, tag=True):
    """A free rung: wait, reattach or verify again until `until_s`."""

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
    """A handoff's decision carried into the mission; approvals come with AuthoriseDispatch instead."""

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
    """Ends that are not success: success comes from JudgeGoal alone."""

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
    """Only with the holder at rest: `static` is the measured displacement by a source outside the localiser."""

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
    """`subject` and `evidence` are what the person saw, `shown` the page that showed it.

    The harness adds what holds now: the state version `k` and `fresh`, a look at the robot. Without them it is
    refused (D28).
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
    """A person's own observation of one condition, on the question as it was shown in this cycle."""

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
    """About to be sent. `actor` is whose word it rests on: their role is asked for once more."""

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
