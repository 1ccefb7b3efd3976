"""Maps each command class to the permission it needs; a command that is not listed is refused."""

from collections.abc import Mapping
from types import MappingProxyType

from app.auth.permissions import NotPermitted, Permission
from harness.contracts import (
    admissions,
    alert_commands,
    commands,
    control,
    erasure_events,
    goal_proposals,
    handoff_commands,
    maps,
    place_events,
    retreat_events,
    revision_commands,
    shadow,
    site_events,
)
from harness.contracts.actors import Actor, Command
from harness.contracts.reasons import because
from rsi_reviews import commands as review_commands
from rsi_reviews import refused_proposals, suite_growth

ASKED: Mapping[type[Command], Permission] = MappingProxyType(
    {
        commands.CreateMission: "drive",
        commands.StopMission: "stop",
        commands.PauseMission: "stop",
        commands.ResumeMission: "drive",
        commands.RaiseVeto: "stop",
        commands.FreeLease: "drive",
        revision_commands.WithdrawMission: "stop",
        revision_commands.TightenConstraints: "stop",
        revision_commands.DisputeCompletion: "dispute",
        control.SetAutonomy: "drive",
        control.LimitAutonomy: "drive",
        maps.AttachCloud: "drive",
        admissions.RecordCheck: "drive",
        goal_proposals.ProposeGoal: "suggest",
        goal_proposals.AnswerProposedGoal: "drive",
        place_events.SavePlace: "drive",
        place_events.RemovePlace: "drive",
        site_events.SaveRoute: "drive",
        site_events.RemoveRoute: "drive",
        site_events.SaveTemplate: "drive",
        site_events.RemoveTemplate: "drive",
        site_events.SaveRobot: "robots",
        site_events.RemoveRobot: "robots",
        handoff_commands.LookAgain: "observe",
        commands.ApproveHandoff: "decide",
        commands.RejectHandoff: "decide",
        commands.AttestHandoff: "attest",
        handoff_commands.TakeClaim: "decide",
        handoff_commands.DropClaim: "decide",
        handoff_commands.ExtendDeadline: "decide",
        handoff_commands.AskColleague: "decide",
        handoff_commands.TakeControl: "decide",
        handoff_commands.ReturnControl: "decide",
        handoff_commands.CloseQuestion: "decide",
        handoff_commands.ChooseAction: "decide",
        alert_commands.AcknowledgeAlert: "alerts",
        alert_commands.ShelveAlert: "alerts",
        alert_commands.SuppressAlert: "alerts",
        alert_commands.RestoreAlert: "alerts",
        alert_commands.AssignAlert: "alerts",
        review_commands.ProposeCandidate: "propose",
        review_commands.OpenReview: "propose",
        review_commands.RecallReview: "propose",
        review_commands.AddComment: "propose",
        review_commands.WithdrawCandidate: "propose",
        review_commands.RequestChanges: "review",
        review_commands.ApproveCandidate: "review",
        review_commands.RejectCandidate: "review",
        review_commands.AdjudicateCanaryMission: "review",
        review_commands.AuthoriseRelease: "release",
        review_commands.BeginCanary: "release",
        review_commands.RollBack: "release",
        review_commands.RetireVersion: "release",
        review_commands.SavePolicy: "policy",
        suite_growth.AddCase: "dispute",
        erasure_events.EraseBlob: "erase",
    }
)
"""What a person or an integration asks for directly. Whose own candidate it is, the release service asks."""

CARRIED: Mapping[type[Command], Permission] = MappingProxyType(
    {
        commands.RefreshHandoff: "observe",
        commands.MarkDispatched: "decide",
        control.BeginTeleoperation: "drive",
        control.EndTeleoperation: "stop",
        control.OrderPosture: "stop",
        refused_proposals.KeepRefusal: "propose",
        retreat_events.SendRetreat: "drive",
        retreat_events.StopRetreat: "stop",
    }
)
"""What carries a person's decision to the gate. The harness builds it; a person never asks for it by this name.

Lying down is a stop, standing up is driving: a posture needs the weaker of the two here, and the page asks for its own.
"""

PERMISSIONS: Mapping[type[Command], Permission] = MappingProxyType({**ASKED, **CARRIED})
"""What whoever gives a command must be permitted, asked when they ask and again inside every commit."""

HARNESS_COMMANDS: frozenset[type[Command]] = frozenset(
    {
        commands.RecompileContract,
        commands.ActivateMission,
        commands.AuthoriseDispatch,
        commands.RecordAdvice,
        commands.RefusePrecondition,
        commands.AcceptInvocation,
        commands.StopInvocation,
        control.RecordPosture,
        commands.ResumeInvocation,
        commands.EndInvocation,
        commands.CompleteNode,
        commands.ReportFailure,
        commands.AuthoriseWait,
        commands.FailNode,
        commands.AskPerson,
        commands.AnswerMission,
        commands.AcknowledgeStop,
        commands.JudgeGoal,
        commands.EndMission,
        commands.RecordObservation,
        commands.ChangeEpoch,
        commands.ClearVeto,
        commands.AcquireLease,
        commands.ReleaseLease,
        commands.QuarantineLease,
        commands.OpenHandoff,
        commands.ExpireHandoff,
        commands.SupersedeHandoff,
        commands.RecordEffect,
        revision_commands.ReviseContract,
        revision_commands.ReviseToRecover,
        revision_commands.PassOverStep,
        handoff_commands.Escalate,
        handoff_commands.VoidApproval,
        handoff_commands.RecordNoAnswer,
        control.RequireNoTeleoperation,
        retreat_events.EndRetreat,
        alert_commands.RaiseAlert,
        alert_commands.ClearAlert,
        alert_commands.NoteNotification,
        erasure_events.ExpireBlob,
        shadow.NoteStackGoal,
        shadow.JudgeStackGoal,
        shadow.NoteStackGoalLost,
        review_commands.BeginEvaluation,
        review_commands.RecordEvaluation,
        review_commands.ExpireAuthorisation,
        review_commands.RecordCanaryMission,
        review_commands.PromoteCandidate,
        review_commands.OpenPointer,
        review_commands.Confirm,
        review_commands.MovePointer,
        review_commands.CountLook,
        review_commands.RecordUptake,
    }
)
"""What only the harness, the evaluator and the release service give. Nobody can ask for it from outside."""


class NoPermissionDeclared(NotPermitted):
    """A command whose class no table names: it is refused until somebody says who may give it."""

    code = "no_permission_declared"


def required_permission(kind: type[Command]) -> Permission:
    """What whoever gives a command of this class must be permitted.

    Raises NotPermitted for one that only the harness gives, NoPermissionDeclared for one that nobody listed.
    """
    if kind in HARNESS_COMMANDS:
        raise NotPermitted(because("command_is_internal", command=kind.__name__))
    if kind not in PERMISSIONS:
        raise NoPermissionDeclared(
            because("no_permission_declared_for", command=kind.__name__), where="app/auth/command_permissions.py"
        )
    return PERMISSIONS[kind]


def asked_permission(kind: type[Command]) -> Permission:
    """The same for a command from outside; raises NotPermitted also for one that the harness builds from an answer."""
    if kind in CARRIED:
        raise NotPermitted(because("command_is_built", command=kind.__name__))
    return required_permission(kind)


def giver(command: Command) -> Actor | None:
    """Whose command it is, where it says so."""
    match command:
        case commands.CreateMission():
            return command.requested_by
        case retreat_events.SendRetreat():
            return command.intent.actor
        case _:
            actor: Actor | None = getattr(command, "actor", None)
            return actor
