"""Commands that the gate decides, in the imperative: plain data without any logic."""

from typing import Literal

import msgspec

from harness.contracts import ids, revision_commands
from harness.contracts.actors import Actor, Command
from harness.contracts.admissions import RecordCheck
from harness.contracts.alert_commands import AlertCommand
from harness.contracts.capabilities import Risk
from harness.contracts.configuration import FailureClass, RecoveryAction, RecoveryPolicy
from harness.contracts.control import Autonomy, ControlCommand, SetAutonomy
from harness.contracts.erasure_events import ErasureCommand
from harness.contracts.events import DispatchIntended, NodePlanned
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.goal_proposals import GoalProposalCommand
from harness.contracts.handoff_commands import HandoffTurn
from harness.contracts.handoff_events import NoAnswer, ProposedAction, Snapshot
from harness.contracts.maps import AttachCloud
from harness.contracts.models import ModelAdvice
from harness.contracts.place_events import PlaceCommand
from harness.contracts.places import Otherwise
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.protocol import InvocationStatus
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.rules import FIRST_RULES, RulesVersion
from harness.contracts.shadow import ShadowCommand
from harness.contracts.site_events import SiteCommand
from harness.contracts.spoken_goals import SpokenGoal
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Name
from harness.contracts.verdicts import GoalVerdict, NodeVerdict


class CreateMission(Command, tag=True):
    mission_id: ids.MissionId
    robot_id: ids.RobotId
    goal: Name
    template: Name
    requested_by: Actor
    configuration: ids.Digest
    contract: TaskContract
    policy: RecoveryPolicy
    seed: int = 0
    labels: dict[str, str] = msgspec.field(default_factory=dict)
    autonomy: Autonomy = "autonomous"
    replay: bool = False
    trial: bool = False
    rules: RulesVersion = FIRST_RULES
    channel: str | msgspec.UnsetType = msgspec.UNSET
    spoken: SpokenGoal | msgspec.UnsetType = msgspec.UNSET


class RecompileContract(Command, tag=True):
    """Compile the goal again under the current configuration; allowed only before the mission is active (D35)."""

    configuration: ids.Digest
    contract: TaskContract
    policy: RecoveryPolicy
    trial: bool = False
    rules: RulesVersion = FIRST_RULES


class ActivateMission(Command, tag=True):
    pass


class AuthoriseDispatch(Command, tag=True):
    """Authorise one invocation, with what pays for it.

    `recovery` pays for it in the same transaction, or `approval` by a person. An `attestation` opens one look without
    motion, free (D17). `handed_back`: the approval is a hand-back and opens such a look. `plan`: the approval revises
    the graph first, and the invocation is the first on it.
    """

    intent: DispatchIntended
    planned: NodePlanned | None = None
    recovery: RecoveryProposal | None = None
    signature: Signature | None = None
    recovery_context: ids.Digest | None = None
    approval: ids.HandoffId | None = None
    approver: Actor | None = None
    attestation: revision_commands.RecordAttestation | None = None
    handed_back: bool = False
    reason: Explanation = ""
    plan: revision_commands.RevisedPlan | None = None


class RecordAdvice(Command, tag=True):
    """Record what a model said about this mission; it changes nothing else."""

    advice: ModelAdvice


class RefusePrecondition(Command, tag=True):
    node_id: ids.NodeId
    precondition: Name
    reason: Explanation
    at_s: float


class AcceptInvocation(Command, tag=True):
    invocation_id: ids.InvocationId
    handle: Name


class StopInvocation(Command, tag=True):
    """Stop an invocation on the supervisor's behalf: a deadline, a recovery step or a person's stop."""

    invocation_id: ids.InvocationId
    reason: Explanation
    recovery: RecoveryProposal | None = None
    recovery_context: ids.Digest | None = None


class ResumeInvocation(Command, tag=True):
    invocation_id: ids.InvocationId


class EndInvocation(Command, tag=True):
    """End an invocation without a packet: the request never arrived, or the outcome is unknown."""

    invocation_id: ids.InvocationId
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

    node_id: ids.NodeId
    invocation_id: ids.InvocationId | None
    failure: FailureClass
    reason: Explanation
    at_s: float


class AuthoriseWait(Command, tag=True):
    """Authorise a free recovery step: wait, reattach or verify again until `until_s`."""

    node_id: ids.NodeId
    proposal: RecoveryProposal
    context: ids.Digest
    until_s: float


class FailNode(Command, tag=True):
    node_id: ids.NodeId
    reason: Explanation
    context: ids.Digest | None = None


class AskPerson(Command, tag=True):
    handoff_id: ids.HandoffId
    node_id: ids.NodeId
    failure: FailureClass
    reason: Explanation
    context: ids.Digest | None = None


class AnswerMission(Command, tag=True):
    """Apply a handoff's decision to the mission; approvals use AuthoriseDispatch instead."""

    handoff_id: ids.HandoffId
    decision: Literal["rejected", "expired", "superseded", "closed"]
    actor: Actor
    reason: Explanation


class PauseMission(Command, tag=True):
    actor: Actor
    reason: Name | Reason


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
    node_id: ids.NodeId | None
    reference: EvidenceReference
    contradicts: tuple[ids.ConditionId, ...] = ()


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
    | RecordAdvice
    | RefusePrecondition
    | AcceptInvocation
    | StopInvocation
    | ResumeInvocation
    | EndInvocation
    | CompleteNode
    | ReportFailure
    | AuthoriseWait
    | FailNode
    | revision_commands.ReviseContract
    | revision_commands.ReviseToRecover
    | revision_commands.PassOverStep
    | revision_commands.TightenConstraints
    | AskPerson
    | revision_commands.DisputeCompletion
    | AnswerMission
    | SetAutonomy
    | PauseMission
    | ResumeMission
    | StopMission
    | revision_commands.WithdrawMission
    | AcknowledgeStop
    | JudgeGoal
    | EndMission
    | RecordObservation
    | ChangeEpoch
    | RaiseVeto
    | ClearVeto
)


class AcquireLease(Command, tag=True):
    resource: ids.ResourceId
    mission_id: ids.MissionId
    invocation_id: ids.InvocationId
    token: Count
    expires_s: float


class ReleaseLease(Command, tag=True):
    """Release a lease, only while its holder is at standstill.

    `static` is the displacement measured by a source outside the localiser.
    """

    invocation_id: ids.InvocationId
    reason: Explanation


class QuarantineLease(Command, tag=True):
    invocation_id: ids.InvocationId
    reason: Explanation


class FreeLease(Command, tag=True):
    actor: Actor
    static: dict[str, float]
    reason: Explanation


LeaseCommand = AcquireLease | ReleaseLease | QuarantineLease | FreeLease


class OpenHandoff(Command, tag=True):
    handoff_id: ids.HandoffId
    mission_id: ids.MissionId
    robot_id: ids.RobotId
    node_id: ids.NodeId
    k: Count
    failure: FailureClass
    reason: Explanation
    risk: Risk
    proposal: ProposedAction | None
    snapshot: Snapshot
    evidence: ids.Digest
    no_answer: NoAnswer
    deadline_at_s: float
    limit_at_s: float | None = None
    choices: tuple[RecoveryAction, ...] = ()
    safe_place: str = ""
    otherwise: Otherwise | Literal[""] = ""
    waiting_places: tuple[ids.PlaceId, ...] = ()


class RefreshHandoff(Command, tag=True):
    k: Count
    proposal: ProposedAction | None
    snapshot: Snapshot
    evidence: ids.Digest
    choices: tuple[RecoveryAction, ...] = ()
    actor: Actor | None = None
    waiting_places: tuple[ids.PlaceId, ...] = ()


class ApproveHandoff(Command, tag=True):
    """Approve a handoff. `subject` and `evidence` are what the person saw, `shown` the page that showed it.

    The harness adds the current state: the state version `k` and `fresh`, a new observation of the robot. Without them
    the command is refused (D28).
    """

    actor: Actor
    reason: Name
    key: Name
    cycle: Count
    subject: ids.Digest
    evidence: ids.Digest
    k: Count | None = None
    fresh: Snapshot | None = None
    shown: ids.Digest | None = None
    claim: str = ""


class RejectHandoff(Command, tag=True):
    actor: Actor
    reason: Name
    key: Name
    cycle: Count
    subject: ids.Digest
    claim: str = ""


class AttestHandoff(Command, tag=True):
    """Attest one condition from a person's own observation, on the question as it was shown in this cycle."""

    actor: Actor
    reason: str
    key: Name
    cycle: Count
    condition_id: ids.ConditionId
    claim: str = ""


class ExpireHandoff(Command, tag=True):
    pass


class SupersedeHandoff(Command, tag=True):
    reason: Explanation


class MarkDispatched(Command, tag=True):
    """Mark an invocation as about to be sent. `actor` is the person who authorised it; their role is checked again."""

    invocation_id: ids.InvocationId
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


AnyCommand = (
    MissionCommand
    | LeaseCommand
    | HandoffCommand
    | ControlCommand
    | AttachCloud
    | AlertCommand
    | PlaceCommand
    | RecordCheck
    | GoalProposalCommand
    | ErasureCommand
    | ShadowCommand
    | SiteCommand
)
