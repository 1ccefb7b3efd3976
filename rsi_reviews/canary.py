"""Evaluates a canary: the metric of each canary mission, and whether the sequential test has reached a result (D34).
Pure. A mean of five missions decides nothing.
"""

from collections.abc import Mapping, Sequence
from math import floor, isfinite, log
from typing import Literal

from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.contracts.values import Moment, Value, encode
from harness.projections.mission import Mission
from rsi_reviews.approval_policy import REVIEWERS, not_a_person, repeated, signed
from rsi_reviews.commands import AdjudicateCanaryMission, RecordCanaryMission
from rsi_reviews.contracts import CanaryTest, Direction, Metric, Section
from rsi_reviews.events import CanaryMissionAdjudicated, CanaryMissionRecorded, CandidateEvent
from rsi_reviews.projections import CanaryEntry, Review

Outcome = Literal["go_on", "hard_fault", "metric_worse", "not_exercised", "passed"]


class CanaryMetrics(Value):
    """What a mission's record says beside its state: handoffs, seconds on the robot's clock, minutes of
    people's time.
    """

    handoffs: int = 0
    mission_s: float = 0.0
    operator_minutes: float = 0.0
    duplicate_starts: int = 0
    choices: int = 0


def value_of(metric: Metric, mission: Mission, course: CanaryMetrics) -> float:
    """The declared metric of one finished mission, as far as its own record shows it.

    `recovery_cost` is counted as in the evaluation (D31): spends, plus the whole task budget for each handoff, safe
    stop or uncompleted mission. What only an adjudicator can see (epistemic, safety, false rejections) is 0 here: the
    adjudicator reports it as a hard fault, not as part of a mean.
    """
    completed = mission.status == "succeeded"
    budget = mission.contract.recovery_total if mission.contract else 0
    measured: Mapping[Metric, float] = {
        "verified_completion": float(completed),
        "contract_false_completion": float(mission.false_completions),
        "duplicate_starts": float(course.duplicate_starts),
        "handoffs": float(course.handoffs),
        "recovery_cost": float(mission.spent_total + budget * (course.handoffs + (not completed))),
        "mission_s": course.mission_s,
        "operator_minutes": course.operator_minutes,
    }
    return measured.get(metric, 0.0)


def exercised(baseline: Configuration, candidate: Configuration, mission: Mission, course: CanaryMetrics) -> bool:
    """Whether a changed component took a decision in this mission."""
    sections: dict[Section, bool] = {
        "context_rules": any(state.attempt for state in mission.nodes.values()),
        "routing": course.choices > 0,
        "templates": mission.template in _changed_templates(baseline, candidate),
        "recovery": _recovered(baseline, candidate, mission),
    }
    return any(
        took_part and encode(getattr(baseline, name)) != encode(getattr(candidate, name))
        for name, took_part in sections.items()
    )


def _changed_templates(baseline: Configuration, candidate: Configuration) -> set[str]:
    before = {template.name: encode(template) for template in baseline.templates}
    return {template.name for template in candidate.templates if before.get(template.name) != encode(template)}


def _recovered(baseline: Configuration, candidate: Configuration, mission: Mission) -> bool:
    old, new = baseline.recovery, candidate.recovery
    changed = {
        name for name in new.ladders.keys() | old.ladders.keys() if new.ladders.get(name) != old.ladders.get(name)
    }
    states = [*mission.nodes.values(), *(past.state for past in mission.history)]
    failures = {failure.failure for state in states for failure in state.failures}
    failures |= {spend.failure for state in states for spend in state.spends}
    if old.approval_share != new.approval_share or old.wait_s != new.wait_s:
        return bool(failures)
    return bool(failures & changed)


def bound_of(values: Sequence[float], test: CanaryTest, direction: Direction) -> float:
    """The value beyond which at most 1 - quantile of `values` lie, strictly: above it for a metric to be lowered.

    Raises ValueError without values or with one that is not finite.
    """
    if not values or not all(isfinite(value) for value in values):
        raise ValueError("a bound needs finite values")
    ranked = sorted(values, reverse=direction == "higher")
    beyond = floor((1.0 - test.quantile) * len(ranked) + 1e-9)
    return ranked[max(0, len(ranked) - beyond - 1)]


def is_worse(value: float, bound: float, direction: Direction) -> bool:
    """Whether the value lies strictly beyond the bound. A value that is not a number counts as worse."""
    return not (value >= bound if direction == "higher" else value <= bound)


def harmful(worse: Sequence[bool], test: CanaryTest) -> bool:
    """Whether the likelihood ratio ever reached 1 / alpha, taking the missions in order."""
    harmless = 1.0 - test.quantile
    evidence = 0.0
    for one in worse:
        evidence += log(test.harmful_share / harmless) if one else log((1 - test.harmful_share) / (1 - harmless))
        if evidence >= log(1.0 / test.alpha):
            return True
    return False


def outcome(review: Review) -> Outcome:
    """The present result of the canary. Every mission must be adjudicated before the canary can pass."""
    if review.manifest is None:
        return "go_on"
    test = review.manifest.canary
    if fault_in(review.canary):
        return "hard_fault"
    if harmful([entry.measured.worse for entry in review.exercised], test):
        return "metric_worse"
    if any(entry.finding is None for entry in review.canary):
        return "go_on"
    if len(review.exercised) >= test.missions:
        return "passed"
    return "not_exercised" if len(review.canary) >= test.window else "go_on"


def fault_in(entries: Sequence[CanaryEntry]) -> tuple[str, MissionId] | None:
    """The first hard fault, measured or found by an adjudicator, with its mission."""
    for entry in entries:
        found = entry.measured.hard or (entry.finding if entry.finding not in (None, "sound") else "")
        if found:
            return found, entry.measured.mission_id
    return None


def record(review: Review, command: RecordCanaryMission, now: Moment) -> Decision[CandidateEvent]:
    """Adds a mission to the canary. Each mission counts once."""
    if review.status != "canary":
        return refused("not_in_canary", because("candidate_is", status=review.status))
    if review.entry(command.measured.mission_id) is not None:
        return Accepted(())
    return Accepted((CanaryMissionRecorded(measured=command.measured, at_s=now.wall_s),))


def adjudicate(review: Review, command: AdjudicateCanaryMission, now: Moment) -> Decision[CandidateEvent]:
    """Records, once per mission, the finding of somebody other than the releaser."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if review.status != "canary":
        return refused("not_in_canary", because("candidate_is", status=review.status))
    if refusal := not_a_person(command.actor, REVIEWERS):
        return refusal
    entry = review.entry(command.mission_id)
    if entry is None:
        return refused("no_canary_mission", mission_id=command.mission_id)
    if entry.by is not None:
        return refused(
            "decided",
            because("canary_finding_stands", actor=entry.by.actor.name, finding=entry.finding, reason=entry.by.reason),
        )
    own = review.released_by is not None and review.released_by.actor.name == command.actor.name
    if own and command.policy.kind == "two_person":
        return refused("own_release", actor=command.actor.name)
    by = signed(command, now, override=own)
    return Accepted((CanaryMissionAdjudicated(mission_id=command.mission_id, finding=command.finding, by=by),))
