"""Decides every command that changes a mission, one match arm per command. Pure."""

from typing import assert_never

from harness.contracts.commands import (
    AcceptInvocation,
    AcknowledgeStop,
    ActivateMission,
    AnswerMission,
    AskPerson,
    AuthoriseDispatch,
    AuthoriseWait,
    ChangeEpoch,
    ClearVeto,
    CompleteNode,
    CreateMission,
    EndInvocation,
    EndMission,
    FailNode,
    JudgeGoal,
    MissionCommand,
    PauseMission,
    RaiseVeto,
    RecompileContract,
    RecordObservation,
    RefusePrecondition,
    ReportFailure,
    ResumeInvocation,
    ResumeMission,
    StopInvocation,
    StopMission,
)
from harness.contracts.control import AutonomySet, SetAutonomy
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.events import (
    ContractCompiled,
    EpochChanged,
    InvocationAccepted,
    InvocationResumed,
    MissionActivated,
    MissionCreated,
    MissionEvent,
    NodeFailed,
    ObservationRecorded,
    VetoCleared,
    VetoRaised,
)
from harness.contracts.reasons import because
from harness.contracts.revision_commands import (
    DisputeCompletion,
    ReviseContract,
    TightenConstraints,
    WithdrawMission,
)
from harness.contracts.tasks import check
from harness.contracts.values import Moment, digest
from harness.gate.completion import complete
from harness.gate.dispatch import authorise, wait
from harness.gate.ends import acknowledge, answer, ask, end, pause, resume, stop, stop_invocation, unfinished, withdraw
from harness.gate.goal import judge
from harness.gate.pins import recompile
from harness.gate.revisions import dispute, revise, tighten
from harness.projections.mission import Mission
from harness.projections.mission_fold import apply


def decide(mission: Mission, command: MissionCommand, now: Moment) -> Decision[MissionEvent]:
    """Accept with events or refuse with a rule and a reason. Raises ContractInvalid for a broken contract."""
    if isinstance(command, CreateMission):
        return _create(mission, command)
    if not mission.version:
        return refused("no_mission")
    if mission.ended and not isinstance(command, CompleteNode | DisputeCompletion):
        return refused("mission_ended", status=mission.status)
    return _decided(mission, command)


def _decided(mission: Mission, command: MissionCommand) -> Decision[MissionEvent]:
    match command:
        case CreateMission():
            return refused("exists", because("mission_exists", mission_id=mission.mission_id))
        case RecompileContract():
            return recompile(mission, command)
        case ActivateMission():
            if mission.status != "compiled":
                return refused("not_compiled", because("mission_is", status=mission.status))
            return Accepted((MissionActivated(),))
        case AuthoriseDispatch():
            return authorise(mission, command)
        case AuthoriseWait():
            return wait(mission, command)
        case CompleteNode():
            return complete(mission, command)
        case RefusePrecondition() | ReportFailure() | EndInvocation():
            return unfinished(mission, command)
        case AcceptInvocation():
            if mission.invocation is None or mission.invocation.intent.invocation_id != command.invocation_id:
                return refused("not_open", because("invocation_not_open", invocation_id=command.invocation_id))
            return Accepted((InvocationAccepted(invocation_id=command.invocation_id, handle=command.handle),))
        case StopInvocation():
            return stop_invocation(mission, command)
        case ResumeInvocation():
            return Accepted((InvocationResumed(invocation_id=command.invocation_id),))
        case FailNode():
            node = mission.nodes.get(command.node_id)
            if node is None or node.status in ("committed", "failed", "superseded"):
                return refused("no_open_stage", because("stage_not_open", node_id=command.node_id))
            return Accepted((NodeFailed(node_id=command.node_id, reason=command.reason, context=command.context),))
        case ReviseContract():
            return revise(mission, command)
        case TightenConstraints():
            return tighten(mission, command)
        case DisputeCompletion():
            return dispute(mission, command)
        case AskPerson():
            return ask(mission, command)
        case AnswerMission():
            return answer(mission, command)
        case SetAutonomy():
            return _autonomy(mission, command)
        case PauseMission():
            return pause(mission, command)
        case ResumeMission():
            return resume(mission, command)
        case StopMission():
            return stop(mission, command)
        case WithdrawMission():
            return withdraw(mission, command)
        case AcknowledgeStop():
            return acknowledge(mission, command)
        case JudgeGoal():
            return judge(mission, command)
        case EndMission():
            return end(mission, command)
        case RecordObservation() | ChangeEpoch() | RaiseVeto() | ClearVeto():
            return _noted(mission, command)
        case _:
            assert_never(command)


def _create(mission: Mission, command: CreateMission) -> Decision[MissionEvent]:
    if mission.version:
        return refused("exists", because("mission_exists", mission_id=command.mission_id))
    check(command.contract)
    created = MissionCreated(
        mission_id=command.mission_id,
        robot_id=command.robot_id,
        goal=command.goal,
        template=command.template,
        requested_by=command.requested_by,
        configuration=command.configuration,
        seed=command.seed,
        labels=command.labels,
        autonomy=command.autonomy,
        replay=command.replay,
        trial=command.trial,
    )
    compiled = ContractCompiled(
        contract=command.contract, contract_digest=digest(command.contract), policy=command.policy
    )
    return Accepted((created, compiled))


def _autonomy(mission: Mission, command: SetAutonomy) -> Decision[MissionEvent]:
    stands = mission.autonomy if command.scope == "mission" else mission.autonomy_limit
    if stands == command.autonomy:
        return Accepted(())
    said = AutonomySet(autonomy=command.autonomy, scope=command.scope, actor=command.actor, reason=command.reason)
    return Accepted((said,))


def _noted(
    mission: Mission, command: RecordObservation | ChangeEpoch | RaiseVeto | ClearVeto
) -> Decision[MissionEvent]:
    match command:
        case RecordObservation():
            noted = ObservationRecorded(
                node_id=command.node_id, reference=command.reference, contradicts=command.contradicts
            )
            return Accepted((noted,))
        case ChangeEpoch():
            return Accepted((EpochChanged(map_version=command.map_version, reason=command.reason),))
        case RaiseVeto():
            if mission.vetoes.get(command.layer) == command.reason:
                return Accepted(())
            return Accepted((VetoRaised(layer=command.layer, reason=command.reason),))
        case ClearVeto():
            if command.layer not in mission.vetoes:
                return refused("not_its_veto", layer=command.layer)
            return Accepted((VetoCleared(layer=command.layer, reason=command.reason),))
        case _:
            assert_never(command)


DECIDER: Decider[Mission, MissionCommand, MissionEvent] = Decider(
    initial=Mission(), apply=apply, decide=decide, codec=Codec(MissionEvent)
)
