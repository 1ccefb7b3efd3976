"""Runs one evaluation from its terms to its report: the cases are fixed first, then run, then judged."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec

from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.values import digest
from rsi_reviews import contracts
from rsi_reviews.acceptance import Evaluation, accepted, predicate_digest
from rsi_reviews.held_out import PER_FAMILY, Looks, Secret, answered, held_out_cases
from rsi_reviews.regression.cases import Case, Suite, cases_of, seeds_digest, spread
from rsi_reviews.regression.executors import Executor
from rsi_reviews.regression.results import ResultsFile, evaluator_version
from rsi_reviews.regression.runner import Watch, measured, unwatched


@dataclass(frozen=True)
class Trial:
    """The cases of one candidate's evaluation. `terms` are recorded before anything runs."""

    candidate: contracts.Candidate
    baseline: Configuration
    regression: tuple[Case, ...]
    safety: tuple[Case, ...]
    terms: contracts.EvaluationTerms

    @property
    def cases(self) -> tuple[Case, ...]:
        """Every case once, those of the regression suite first."""
        return tuple(dict.fromkeys((*self.regression, *self.safety)))


@dataclass(frozen=True)
class HeldOut:
    """The evaluator's private part: its secret, its record of looks, and the number of cases per family in a look."""

    secret: Secret
    looks: Looks
    per_family: int = PER_FAMILY


@dataclass(frozen=True)
class Means:
    """The resources of a trial. `now_s` is a clock that only rises; without `held_out` no look is taken."""

    executor: Executor
    now_s: Callable[[], float]
    kept: ResultsFile | None = None
    held_out: HeldOut | None = None
    watch: Watch = unwatched


@dataclass(frozen=True)
class TrialOutcome:
    """What was measured, and the predicate's report on it."""

    results: contracts.ResultSet
    report: contracts.AcceptanceReport


def prepared(
    candidate: contracts.Candidate,
    baseline: Configuration,
    suites: tuple[Suite, Suite],
    *,
    launched_by: tuple[str, ...],
    simulator: Simulator,
    suite_edited_by: tuple[str, ...] = (),
    most: int | None = None,
) -> Trial:
    """The trial of a candidate on the regression and the safety suite, whose cases will run on this simulator.

    `most` cases of each give a quick look, whose report can never pass. Raises ContractInvalid for another baseline.
    """
    if baseline.configuration_id != candidate.baseline:
        raise ContractInvalid(
            because(
                "candidate_of_other_baseline", baseline=candidate.baseline[:12], current=baseline.configuration_id[:12]
            ),
            where="baseline",
        )
    regression, safety = (cases_of(suite) for suite in suites)
    if most is not None:
        regression, safety = spread(regression, most), spread(safety, most)
    cases = tuple(dict.fromkeys((*regression, *safety)))
    terms = contracts.EvaluationTerms(
        candidate=candidate.candidate_id,
        configuration=candidate.configuration.configuration_id,
        manifest=digest(candidate.manifest),
        baseline=candidate.baseline,
        predicate=predicate_digest(),
        suite=digest([suite.suite_id for suite in suites]),
        suite_version=", ".join(f"{suite.name} {suite.version}" for suite in suites),
        seeds=seeds_digest(cases),
        evaluator=evaluator_version(simulator.sources()),
        cases=len(cases),
        launched_by=launched_by,
        suite_edited_by=suite_edited_by,
    )
    return Trial(candidate=candidate, baseline=baseline, regression=regression, safety=safety, terms=terms)


def carried_out(trial: Trial, means: Means) -> TrialOutcome:
    """Run every case under both configurations, take the held-out look if everything else passes, and judge.

    Raises WorkersLost or LookTaken; finished cases are kept, so that the next call continues where this one ended.
    """
    begun_s = means.now_s()
    sides = (trial.baseline, trial.candidate.configuration)
    results = measured(trial.cases, sides, executor=means.executor, file=means.kept, watch=means.watch)
    found = contracts.ResultSet(
        terms=digest(trial.terms), results=exercised(results, trial.baseline), seconds=means.now_s() - begun_s
    )
    whole = _looked(trial, found, means)
    return TrialOutcome(results=whole, report=_judged(trial, whole))


def exercised(results: Sequence[contracts.CaseResult], baseline: Configuration) -> tuple[contracts.CaseResult, ...]:
    """The results, each with whether the change was exercised: its mission took another course than the baseline's."""
    name = baseline.configuration_id
    courses = {one.case: one.trace for one in results if one.configuration == name}
    return tuple(
        msgspec.structs.replace(one, exercised=one.configuration != name and one.trace != courses.get(one.case))
        for one in results
    )


def _looked(trial: Trial, found: contracts.ResultSet, means: Means) -> contracts.ResultSet:
    """The results with the held-out answer, where only that is missing: no look is spent on a candidate that
    fails anyway.
    """
    if means.held_out is None:
        return found
    hoped = contracts.HeldOutAnswer(answer="pass", look=1, alpha=0.0, cases=1)
    if _judged(trial, msgspec.structs.replace(found, held_out=hoped)).answer != "pass":
        return found
    return msgspec.structs.replace(found, held_out=_look(trial, means, means.held_out))


def _look(trial: Trial, means: Means, held_out: HeldOut) -> contracts.HeldOutAnswer:
    """This candidate's look, or the answer it already got. Its cases and results are not stored outside the
    evaluator.
    """
    candidate, manifest = trial.candidate, trial.candidate.manifest
    before = held_out.looks.taken(candidate.candidate_id)
    if before is not None:
        return before
    look = held_out.looks.open(candidate.candidate_id, trial.terms.manifest)
    cases = held_out_cases(held_out.secret, candidate.candidate_id, per_family=held_out.per_family)
    sides = (trial.baseline, candidate.configuration)
    results = measured(cases, sides, executor=means.executor)
    answer = answered(look, manifest, cases, results, candidate.configuration.configuration_id)
    held_out.looks.close(look, answer)
    return answer


def _judged(trial: Trial, results: contracts.ResultSet) -> contracts.AcceptanceReport:
    return accepted(judged_on(trial, results))


def judged_on(trial: Trial, results: contracts.ResultSet) -> Evaluation:
    """The inputs of the acceptance predicate, for whoever judges again."""
    return Evaluation(
        terms=trial.terms,
        manifest=trial.candidate.manifest,
        regression=trial.regression,
        safety=trial.safety,
        results=results,
    )
