"""Decides what a goal verdict leads to: success, one more look, a reopened stage, or an honest end (D29). Pure."""

from collections.abc import Iterator

from harness.contracts import effects, events
from harness.contracts.commands import JudgeGoal
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.ids import ConditionId, NodeId
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.revision_events import GraphRevised
from harness.contracts.tasks import TaskContract, order, targets_of
from harness.contracts.verdicts import GoalVerdict, Verdict, strictest
from harness.gate.rules import not_vouched
from harness.planning.revision import reopened_with
from harness.projections.mission import Mission, all_required_settled, declared_goals, required_contract
from harness.projections.readings import cited_in_words, goal_in_words
from harness.projections.region import contains
from harness.recovery.state import left_now, over_budget


def judge(mission: Mission, command: JudgeGoal) -> Decision[events.MissionEvent]:
    """The only way to SUCCEEDED: a satisfied verdict over every original completion condition (R118, R119).

    Where a stage is only declared the best end is PARTLY_VERIFIED: every condition that does not rest on it holds.
    """
    verdict, contract = command.verdict, required_contract(mission)
    refusal = _unready(mission, verdict)
    if refusal:
        return refusal
    worst = _worst(mission, verdict)
    if worst == "satisfied" and mission.declared and not mission.vetoes and not mission.disputed:
        return _partly(mission, verdict)
    if worst == "satisfied" and not mission.vetoes and not mission.disputed:
        text = because("goal_met", goal=goal_in_words(contract), reason=verdict.reason)
        done = events.MissionEnded(status="succeeded", reason=because("goal_verdict_satisfied"))
        return Accepted((events.GoalVerified(verdict=verdict), events.CompletionReported(text=text), done))
    if worst == "ambiguous" and not mission.relooks and contract.recovery_total > mission.spent_total:
        return Accepted((events.GoalVerified(verdict=verdict, relook=True),))
    why = _shortfall(mission, verdict)
    if worst == "violated" or mission.disputed:
        again = reopening(mission, verdict)
        if isinstance(again, GraphRevised):
            return Accepted((events.GoalVerified(verdict=verdict), again))
        why = because("not_reopened", why=why, again=again)
    failed = failed_clauses(contract, verdict)
    reason = because("goal_not_met", verdict=worst, why=why)
    if failed:
        reason = because("clauses_not_met", verdict=worst, clauses=failed, why=why)
    return Accepted(
        (
            events.GoalVerified(verdict=verdict),
            events.FailureReported(text=reason),
            events.MissionEnded(status="failed", reason=reason),
        )
    )


def _worst(mission: Mission, verdict: GoalVerdict) -> Verdict:
    """The strictest verdict, without the conditions that are undecided because they rest on a declared stage."""
    unverified = {condition.condition_id for condition in declared_goals(mission)}
    left_out = {
        one.condition_id for one in verdict.results if one.verdict == "ambiguous" and one.condition_id in unverified
    }
    decisive = tuple(one.verdict for one in verdict.results if one.condition_id not in left_out)
    contract = required_contract(mission)
    if not_vouched(contract, contract.completion_conditions):
        decisive = (*decisive, "ambiguous")
    if left_out and verdict.verdict == "ambiguous":
        return strictest(decisive)
    return strictest((verdict.verdict, *decisive))


def _partly(mission: Mission, verdict: GoalVerdict) -> Accepted[events.MissionEvent]:
    """Never a completion: what rests on a provider's word alone is named."""
    parts = tuple(dict.fromkeys(effect.text for effect in mission.declared))
    goal = goal_in_words(required_contract(mission))
    ended = events.MissionEnded(status="partly_verified", reason=because("rests_on_word_alone", parts=parts))
    text = because("goal_partly_verified", goal=goal, parts=parts)
    return Accepted((events.GoalVerified(verdict=verdict), events.PartialCompletionReported(text=text), ended))


def reopening(mission: Mission, verdict: GoalVerdict) -> GraphRevised | Reason:
    """The responsible stage reopened, paid as a local_replan; or the reason why not."""
    contract = required_contract(mission)
    found = responsible(mission, verdict)
    if found is None:
        return because("no_stage_answers")
    condition_id, node_id = found
    if unpaid := over_budget(mission, node_id, "local_replan"):
        return because("stage_not_reopened", stage=node_id, why=unpaid)
    left = left_now(mission, node_id)
    return GraphRevised(
        revision=mission.graph_revision + 1,
        cause="goal",
        responsible=node_id,
        reopened=reopened_with(contract, node_id),
        reason=_shortfall(mission, verdict),
        condition_id=condition_id,
        left_node=left[0] - 1,
        left_mission=left[1] - 1,
    )


def responsible(mission: Mission, verdict: GoalVerdict) -> tuple[ConditionId | None, NodeId] | None:
    """The condition that failed and the latest stage responsible for it: a disputed one first.

    What was done at another place than it should begins again with the way there.
    """
    contract = required_contract(mission)
    if mission.disputed:
        return mission.disputed[0].condition_id, mission.disputed[0].node_id
    violated = {result.condition_id for result in verdict.results if result.verdict == "violated"}
    for condition in contract.completion_conditions:
        if condition.condition_id not in violated:
            continue
        named = set(_answering(condition.effect, contract))
        late = [node_id for node_id in order(contract) if node_id in named and _done(mission, node_id)]
        if late:
            return condition.condition_id, _way_to(condition.effect, contract, late[-1], mission) or late[-1]
    return None


def _way_to(effect: effects.AnyEffect, contract: TaskContract, stage: NodeId, mission: Mission) -> NodeId | None:
    """The last leg before a stage that leads to where it should have been done; None where no leg does."""
    if not isinstance(effect, effects.Relational) or effect.predicate != "one_subject" or len(effect.region_m) < 3:
        return None
    names = order(contract)
    legs = (
        name
        for name in reversed(names[: names.index(stage) + 1])
        if _done(mission, name) and any(contains(effect.region_m, target) for target in targets_of(contract.node(name)))
    )
    return next(legs, None)


def _answering(effect: effects.AnyEffect, contract: TaskContract) -> Iterator[NodeId]:
    """Stages that the effect names, or that had to achieve the same."""
    match effect:
        case effects.Temporal():
            yield from effect.nodes
        case effects.Relational():
            yield from (NodeId(effect.subject), NodeId(effect.object))
        case effects.Symbolic():
            yield from (NodeId(name) for name in effect.arguments.values())
        case effects.Metric() | effects.Visual():
            pass
    for node in contract.nodes:
        if any(_same(effect, own.effect) for own in node.success_conditions):
            yield node.node_id


def _same(effect: effects.AnyEffect, own: effects.AnyEffect) -> bool:
    """Whether a stage's own condition is about the same: the same target in the map, or the same effect."""
    if isinstance(effect, effects.Metric):
        return isinstance(own, effects.Metric) and own.target_m == effect.target_m
    return effect == own


def _done(mission: Mission, node_id: NodeId) -> bool:
    return mission.of(node_id).status == "committed"


def failed_clauses(contract: TaskContract, verdict: GoalVerdict) -> tuple[Reason, ...]:
    """The clauses of the reading that have a condition which does not hold, in their order (D44)."""
    cited = {one.condition_id: one.clause for one in contract.completion_conditions}
    failing = [cited.get(one.condition_id) for one in verdict.results if one.verdict != "satisfied"]
    clauses = (cited_in_words(contract, one) for one in dict.fromkeys(failing))
    return tuple(one for one in clauses if one is not None)


def _shortfall(mission: Mission, verdict: GoalVerdict) -> Explanation:
    if not mission.disputed:
        return verdict.reason
    return because("condition_disputed", condition=mission.disputed[0].condition_id)


def _unready(mission: Mission, verdict: GoalVerdict) -> Refused | None:
    contract = required_contract(mission)
    if mission.status not in ("active", "goal_check") or mission.invocation is not None:
        return refused("not_ready", because("goal_not_ready", status=mission.status))
    if verdict.mission_id != mission.mission_id:
        return refused("wrong_identity", because("goal_of_another_mission", mission_id=verdict.mission_id))
    if not all_required_settled(mission):
        return refused("nodes_open")
    declared = [condition.condition_id for condition in contract.completion_conditions]
    if sorted(declared) != sorted(result.condition_id for result in verdict.results):
        return refused("uncovered_condition", because("goal_conditions_uncovered"))
    return None
