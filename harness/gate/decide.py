"""Decides every command that changes a mission, one match arm per command. Pure."""

from typing import assert_never

from harness.contracts import commands, events
from harness.contracts.control import AutonomySet, SetAutonomy
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import because
from harness.contracts.revision_commands import (
    DisputeCompletion,
    PassOverStep,
    ReviseContract,
    ReviseToRecover,
    TightenConstraints,
    WithdrawMission,
)
from harness.contracts.tasks import check
from harness.contracts.values import Moment, digest
from harness.gate import ends
from harness.gate.completion import complete
from harness.gate.dispatch import authorise, wait
from harness.gate.goal import judge
from harness.gate.pins import recompile
from harness.gate.revisions import dispute, pass_over, revise, revise_to_recover, start_revised, tighten
from harness.projections.mission import Mission
from harness.projections.mission_fold import apply


def decide(mission: Mission, command: commands.MissionCommand, now: Moment) -> Decision[events.MissionEvent]:
    """Accept with events or refuse with a rule and a reason. Raises ContractInvalid for a broken contract."""
    if isinstance(command, commands.CreateMission):
        return _create(mission, command)
    if not mission.version:
        return refused("no_mission")
    if mission.ended and not isinstance(command, commands.CompleteNode | DisputeCompletion):
        return refused("mission_ended", status=mission.status)
    return _decided(mission, command)


def _decided(mission: Mission, command: commands.MissionCommand) -> Decision[events.MissionEvent]:
    match command:
        case commands.CreateMission():
            return refused("exists", because("mission_exists", mission_id=mission.mission_id))
        case commands.RecompileContract():
            return recompile(mission, command)
        case commands.ActivateMission():
            if mission.status != "compiled":
                return refused("not_compiled", because("mission_is", status=mission.status))
            return Accepted((events.MissionActivated(),))
        case commands.AuthoriseDispatch():
            return start_revised(mission, command, command.plan) if command.plan else authorise(mission, command)
        case commands.AuthoriseWait():
            return wait(mission, command)
        case commands.RecordAdvice(advice=advice):
            if advice.node_id is not None and advice.node_id not in mission.nodes:
                return refused("unknown_node", because("node_not_in_graph", node_id=advice.node_id[:80]))
            return Accepted((events.ModelAdvised(advice=advice),))
        case commands.CompleteNode():
            return complete(mission, command)
        case commands.RefusePrecondition() | commands.ReportFailure() | commands.EndInvocation():
            return ends.unfinished(mission, command)
        case commands.AcceptInvocation():
            if mission.invocation is None or mission.invocation.intent.invocation_id != command.invocation_id:
                return refused("not_open", because("invocation_not_open", invocation_id=command.invocation_id))
            return Accepted((events.InvocationAccepted(invocation_id=command.invocation_id, handle=command.handle),))
        case commands.StopInvocation():
            return ends.stop_invocation(mission, command)
        case commands.ResumeInvocation():
            return Accepted((events.InvocationResumed(invocation_id=command.invocation_id),))
        case commands.FailNode():
            node = mission.nodes.get(command.node_id)
            if node is None or node.status in ("committed", "declared", "failed", "superseded"):
                return refused("no_open_stage", because("stage_not_open", node_id=command.node_id))
            return Accepted(
                (events.NodeFailed(node_id=command.node_id, reason=command.reason, context=command.context),)
            )
        case ReviseContract():
            return revise(mission, command)
        case ReviseToRecover():
            return revise_to_recover(mission, command)
        case PassOverStep():
            return pass_over(mission, command)
        case TightenConstraints():
            return tighten(mission, command)
        case DisputeCompletion():
            return dispute(mission, command)
        case commands.AskPerson():
            return ends.ask(mission, command)
        case commands.AnswerMission():
            return ends.answer(mission, command)
        case SetAutonomy():
            return _autonomy(mission, command)
        case commands.PauseMission():
            return ends.pause(mission, command)
        case commands.ResumeMission():
            return ends.resume(mission, command)
        case commands.StopMission():
            return ends.stop(mission, command)
        case WithdrawMission():
            return ends.withdraw(mission, command)
        case commands.AcknowledgeStop():
            return ends.acknowledge(mission, command)
        case commands.JudgeGoal():
            return judge(mission, command)
        case commands.EndMission():
            return ends.end(mission, command)
        case commands.RecordObservation() | commands.ChangeEpoch() | commands.RaiseVeto() | commands.ClearVeto():
            return _noted(mission, command)
        case _:
            assert_never(command)


def _create(mission: Mission, command: commands.CreateMission) -> Decision[events.MissionEvent]:
    if mission.version:
        return refused("exists", because("mission_exists", mission_id=command.mission_id))
    check(command.contract, rules=command.rules)
    created = events.MissionCreated(
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
        channel=command.channel,
        spoken=command.spoken,
    )
    compiled = events.ContractCompiled(
        contract=command.contract,
        contract_digest=digest(command.contract),
        policy=command.policy,
        rules=command.rules,
    )
    return Accepted((created, compiled))


def _autonomy(mission: Mission, command: SetAutonomy) -> Decision[events.MissionEvent]:
    stands = mission.autonomy if command.scope == "mission" else mission.autonomy_limit
    if stands == command.autonomy:
        return Accepted(())
    event = AutonomySet(autonomy=command.autonomy, scope=command.scope, actor=command.actor, reason=command.reason)
    return Accepted((event,))


def _noted(
    mission: Mission,
    command: commands.RecordObservation | commands.ChangeEpoch | commands.RaiseVeto | commands.ClearVeto,
) -> Decision[events.MissionEvent]:
    match command:
        case commands.RecordObservation():
            noted = events.ObservationRecorded(
                node_id=command.node_id, reference=command.reference, contradicts=command.contradicts
            )
            return Accepted((noted,))
        case commands.ChangeEpoch():
            return Accepted((events.EpochChanged(map_version=command.map_version, reason=command.reason),))
        case commands.RaiseVeto():
            if mission.vetoes.get(command.layer) == command.reason:
                return Accepted(())
            return Accepted((events.VetoRaised(layer=command.layer, reason=command.reason),))
        case commands.ClearVeto():
            if command.layer not in mission.vetoes:
                return refused("not_its_veto", layer=command.layer)
            return Accepted((events.VetoCleared(layer=command.layer, reason=command.reason),))
        case _:
            assert_never(command)


DECIDER: Decider[Mission, commands.MissionCommand, events.MissionEvent] = Decider(
    initial=Mission(),
    apply=apply,
    decide=decide,
    codec=Codec(events.MissionEvent),
    from_events=(commands.JudgeGoal,),
)
