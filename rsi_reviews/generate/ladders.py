"""Estimates what the steps of the recovery ladders achieved, and which one change of a ladder should pay. Pure.

Costs count as the suite counts them: one per spending step, the whole task budget for a question to a person.
"""

from collections.abc import Iterator, Sequence

from harness.contracts.configuration import SPENDING, Configuration, FailureClass, RecoveryAction
from harness.contracts.values import Value
from harness.recovery.state import OBSERVING
from rsi_reviews.generate import changes
from rsi_reviews.generate.trace import Trace, TracedStep
from rsi_reviews.restrictions import LOCKED_LADDERS

TASK_BUDGET = 8.0
LEAST_EPISODES = 2
SMALLEST_EFFECT = 0.05
UNTRIED = 0.5
"""How likely a rung helps that nobody has tried yet: nothing is known, so as likely as not."""
LOOKED_AT: tuple[FailureClass, ...] = ("stale_evidence", "ambiguous", "target_not_found", "commit_rejected")
"""Failures of evidence: looking again, or longer, is what can help."""
MOVED: tuple[FailureClass, ...] = ("no_progress", "violated", "interrupted", "timeout")
"""Failures of an execution: another provider can help."""


class StepTrial(Value):
    """One step of one ladder: how often it was taken, and how often the stage was accepted right after it."""

    action: RecoveryAction
    times: int
    helped: int

    @property
    def chance(self) -> float:
        """The probability that the step helps, with a Beta(1, 1) prior."""
        return (self.helped + 1) / (self.times + 2)


def ladder_changes(trace: Trace, current: Configuration) -> Iterator[changes.ProposedChange]:
    """Changes of single ladders that are supported by the outcomes of their steps."""
    for failure, ladder in current.recovery.ladders.items():
        episodes = _episodes(trace, failure)
        if episodes < LEAST_EPISODES or failure in LOCKED_LADDERS or ladder[0] in ("stop", "safe_stop"):
            continue
        trials = {action: _trial(trace, failure, action) for action in (*ladder, *OBSERVING, "switch_skill", "retry")}
        now = _expected(ladder, trials)
        for other in _ladders(failure, ladder):
            saved = now - _expected(other, trials)
            if saved > 0:
                yield _change(trace, current, failure=failure, ladder=other, saved=saved)


def _episodes(trace: Trace, failure: FailureClass) -> int:
    return sum(1 for mission in trace.missions for one in mission.failures if one.failure == failure)


def _trial(trace: Trace, failure: FailureClass, action: RecoveryAction) -> StepTrial:
    rungs = [one for one in _rungs(trace, failure) if one.action == action and one.came != "open"]
    return StepTrial(action=action, times=len(rungs), helped=sum(1 for one in rungs if one.came == "committed"))


def _rungs(trace: Trace, failure: FailureClass) -> list[TracedStep]:
    return [step for mission in trace.missions for step in mission.rungs if step.failure == failure]


def _expected(ladder: changes.Ladder, trials: dict[RecoveryAction, StepTrial]) -> float:
    """Expected recovery cost of one episode on this ladder, with the steps taken as independent."""
    cost, left = 0.0, 1.0
    for action in ladder:
        if action == "human":
            return cost + left * TASK_BUDGET
        cost += left * (1.0 if action in SPENDING else 0.0)
        one = trials.get(action)
        left *= 1.0 - (one.chance if one is not None else UNTRIED)
    return cost


def _ladders(failure: FailureClass, ladder: changes.Ladder) -> Sequence[changes.Ladder]:
    """Ladders that differ by one change: a step dropped, two neighbours swapped, a step moved to the front, a
    look added.
    """
    rungs = ladder[:-1]
    found: list[changes.Ladder] = [rungs[:at] + rungs[at + 1 :] for at in range(len(rungs))]
    found += [(*rungs[:at], rungs[at + 1], rungs[at], *rungs[at + 2 :]) for at in range(len(rungs) - 1)]
    if failure in MOVED:
        found.append(("switch_skill",))
    if failure in LOOKED_AT:
        found += [(look, *rungs) for look in OBSERVING] + [(*rungs, look) for look in OBSERVING]
    return [(*other, "human") for other in dict.fromkeys(found) if other and other != rungs]


def _change(
    trace: Trace, current: Configuration, *, failure: FailureClass, ladder: changes.Ladder, saved: float
) -> changes.ProposedChange:
    episodes, missions = _episodes(trace, failure), len(trace.missions)
    text = "; ".join(_reason_text(_trial(trace, failure, action)) for action in current.recovery.ladders[failure][:-1])
    handoffs = sum(1 for mission in trace.missions for one in mission.handoffs if one.failure == failure)
    old, new = " > ".join(current.recovery.ladders[failure]), " > ".join(ladder)
    return changes.ProposedChange(
        section="recovery",
        configuration=changes.with_ladder(current, failure, ladder),
        reason=f"{failure} occurred {episodes} times in {missions} missions; {text}; "
        f"a person was asked {handoffs} times.",
        intended=f"The ladder of {failure} becomes {new} instead of {old}, which should save {saved:.2f} per episode.",
        metric="recovery_cost",
        smallest_effect=SMALLEST_EFFECT,
        worth=saved * episodes / max(missions, 1),
        motives=changes.motives(trace, changes.failures_of(failure)),
    )


def _reason_text(trials: StepTrial) -> str:
    return f"{trials.action} helped {trials.helped} of {trials.times} times"
