"""Proposes waits, timeouts and context budgets from what missions really needed. Pure."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator

from harness.contracts.configuration import Configuration, FailureClass
from harness.contracts.ids import NodeId
from harness.contracts.reasons import parts
from rsi_reviews.generate import changes
from rsi_reviews.generate.ladders import SMALLEST_EFFECT, TASK_BUDGET
from rsi_reviews.generate.trace import MissionTrace, Trace, TracedExecution
from rsi_reviews.restrictions import ITEM_CEILINGS, longest_idle_s

WAITED: tuple[FailureClass, ...] = ("precondition_unmet", "resource_conflict")
LEAST = 2
OVER_OBSERVED = 1.3
OVER_EXPECTED = 1.25
WORTH_TIGHTENING = 0.85
SECONDS_PER_SPEND = 60.0
"""One recovery spend is ranked like so many seconds of a mission."""
SMALLEST_S = 2.0


def wait_changes(trace: Trace, current: Configuration) -> Iterator[changes.ProposedChange]:
    """Where waits ended without the result and a person was asked: wait again in the place of a step that cannot help,
    or, where no wait ever helped, half as long. A person is asked no later than before (D30a).
    """
    for failure in WAITED:
        waits = [
            step for mission in trace.missions for step in mission.rungs
            if step.failure == failure and step.action == "wait"
        ]  # fmt: skip
        in_vain = sum(1 for step in waits if step.came in ("failed_again", "handed_off"))
        asks = sum(1 for mission in trace.missions for one in mission.handoffs if one.failure == failure)
        if min(in_vain, asks) < LEAST:
            continue
        wait_s, ladder = current.recovery.wait_s, current.recovery.ladders[failure]
        if longer := _waiting_again(ladder, wait_s):
            configuration = changes.with_ladder(current, failure, longer)
            intended = f"After {failure} the stage waits again instead of taking a step that frees no resource."
        elif in_vain == len(waits):
            configuration = changes.with_wait(current, 0.5 * wait_s)
            intended = f"Waits last {0.5 * wait_s:g} s instead of {wait_s:g} s, and a person is asked sooner."
        else:
            continue
        yield changes.ProposedChange(
            section="recovery",
            configuration=configuration,
            reason=f"{in_vain} of {len(waits)} waits after {failure} did not help; a person was asked {asks} times.",
            intended=intended,
            metric="recovery_cost",
            smallest_effect=SMALLEST_EFFECT,
            worth=0.5 * TASK_BUDGET * asks / len(trace.missions),
            motives=changes.motives(trace, changes.failures_of(failure)),
        )


def _waiting_again(ladder: changes.Ladder, wait_s: float) -> changes.Ladder | None:
    """The ladder with a second wait for the last step before a person; None where a person would be asked later."""
    if len(ladder) < 3 or ladder[-2] == "wait":
        return None
    longer: changes.Ladder = (*ladder[:-2], "wait", "human")
    return longer if longest_idle_s(longer, wait_s) <= longest_idle_s(ladder, wait_s) else None


def timeout_changes(trace: Trace, current: Configuration) -> Iterator[changes.ProposedChange]:
    """A shorter timeout, where stages reached it and every accepted execution took much less."""
    late: dict[tuple[str, NodeId], int] = defaultdict(int)
    for mission in trace.missions:
        for failing in mission.failures:
            late[(mission.template, failing.node_id)] += failing.failure == "timeout"
    for (template, node_id), times in sorted(late.items()):
        executions = [one for one in _executions(trace, template) if one.node_id == node_id and not one.verify_only]
        accepted = [one for one in executions if one.committed]
        if times < LEAST or not accepted:
            continue
        now_s = max(one.timeout_s for one in executions)
        longest_s = max(one.duration_s for one in accepted)
        slowest_s = max((seconds for one in executions for seconds in one.expected_s.values()), default=longest_s)
        tighter_s = 5.0 * math.ceil(max(OVER_OBSERVED * longest_s, OVER_EXPECTED * slowest_s) / 5.0)
        if tighter_s <= WORTH_TIGHTENING * now_s:
            yield changes.ProposedChange(
                section="templates",
                configuration=changes.with_timeout(current, template=template, node_id=node_id, timeout_s=tighter_s),
                reason=f"Stage {node_id} of {template} reached its timeout of {now_s:g} s {times} times; the longest "
                f"accepted execution took {longest_s:.0f} s, and the slowest provider expects {slowest_s:.0f} s.",
                intended=f"The stage times out after {tighter_s:g} s, and the next recovery step follows.",
                metric="mission_s",
                smallest_effect=SMALLEST_S,
                worth=(now_s - tighter_s) * times / len(trace.missions) / SECONDS_PER_SPEND,
                motives=changes.motives(trace, changes.failures_of("timeout")),
            )


def item_changes(trace: Trace, current: Configuration) -> Iterator[changes.ProposedChange]:
    """A larger context budget, where mandatory records did not fit one that is below its ceiling."""
    for role, name in (("planner", "c1_items"), ("skill", "c2_items"), ("recovery", "c4_items")):
        overflows = _overflows(role)
        times = sum(len(overflows(mission)) for mission in trace.missions)
        items, ceiling = getattr(current.context_rules, name), ITEM_CEILINGS[name]
        if times >= LEAST and items < ceiling:
            more = min(ceiling, math.ceil(1.5 * items))
            yield changes.ProposedChange(
                section="context_rules",
                configuration=changes.with_items(current, **{name: more}),
                reason=f"Mandatory records exceeded the {role}'s budget of {items} records {times} times.",
                intended=f"The {role} is shown up to {more} records.",
                metric="recovery_cost",
                smallest_effect=SMALLEST_EFFECT,
                worth=0.5 * TASK_BUDGET * times / len(trace.missions),
                motives=changes.motives(trace, overflows),
            )


def _executions(trace: Trace, template: str) -> list[TracedExecution]:
    return [one for mission in trace.missions if mission.template == template for one in mission.executions]


def _overflows(role: str) -> Callable[[MissionTrace], list[int]]:
    """The log positions of failures because mandatory records exceeded this role's budget."""
    return lambda mission: [
        failing.position
        for failing in mission.failures
        if any(one.code == "context_overflow" and one.facts["role"] == role for one in parts(failing.reason))
    ]
