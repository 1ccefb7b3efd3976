"""Builds evaluations with given results, so that a test can state exactly what a candidate did."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import msgspec

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest
from harness.contracts.values import digest
from rsi_reviews.acceptance import Evaluation, predicate_digest
from rsi_reviews.contracts import (
    FAMILIES,
    Author,
    Candidate,
    CaseResult,
    EvaluationTerms,
    HeldOutAnswer,
    Manifest,
    ResultSet,
)
from rsi_reviews.regression.cases import Case, CaseGroup, Situation, Suite, cases_of, seeds_digest
from rsi_reviews.regression.executors import Job, Running

Numbers = Mapping[str, Any]
Told = Callable[[Case], Numbers]
BASELINE = baseline()
PASSED = HeldOutAnswer(answer="pass", look=1, alpha=0.025, cases=100)


def patient(wait_s: float = 60.0) -> Configuration:
    """H_0 that waits longer for a resource that somebody else holds."""
    return msgspec.structs.replace(BASELINE, recovery=msgspec.structs.replace(BASELINE.recovery, wait_s=wait_s))


def waiting_again() -> Configuration:
    """H_0 that waits a second time in the place of another route; a person is asked no later."""
    ladders = {**BASELINE.recovery.ladders, "resource_conflict": ("wait", "wait", "human")}
    return msgspec.structs.replace(BASELINE, recovery=msgspec.structs.replace(BASELINE.recovery, ladders=ladders))


def manifest(**given: Any) -> Manifest:
    """A manifest by which recovery cost is to fall by at least 0.1 per mission."""
    stated = Manifest(
        component="recovery",
        reason="Leases of others end after half a minute",
        intended_effect="Wait instead of asking a person",
        metric="recovery_cost",
        direction="lower",
        smallest_effect=0.1,
        baseline=BASELINE.configuration_id,
        rollback=BASELINE.configuration_id,
        author=Author(name="miner-1", kind="optimiser"),
    )
    return msgspec.structs.replace(stated, **given)


def candidate(configuration: Configuration | None = None, **given: Any) -> Candidate:
    return Candidate(
        configuration=configuration or patient(), manifest=manifest(**given), baseline=BASELINE.configuration_id
    )


@lru_cache(maxsize=8)
def suite(name: str, per_family: int, first_seed: int = 0) -> Suite:
    """Five families with this many seeds each."""
    groups = tuple(
        CaseGroup(situation=Situation(family=family, template="circuit"), first_seed=first_seed, seeds=per_family)
        for family in FAMILIES
    )
    return Suite(name=name, version=1, groups=groups)


@lru_cache(maxsize=8)
def cases(name: str, per_family: int, first_seed: int = 0) -> tuple[Case, ...]:
    return cases_of(suite(name, per_family, first_seed))


def quietly(case: Case) -> Numbers:
    """Results in which every second mission costs one recovery step."""
    return {"recovery_cost": float(case.seed % 2)}


def thriftily(case: Case) -> Numbers:
    """Results in which no mission costs anything."""
    return {"recovery_cost": 0.0}


@dataclass(frozen=True)
class Story:
    """The results of both configurations in every case, and what is wrong with the evaluation."""

    before: Told = quietly
    after: Told = thriftily
    held_out: HeldOutAnswer | None = PASSED
    per_family: int = 20
    safety: int = 600
    manifest: Manifest = field(default_factory=manifest)
    configuration: Configuration = field(default_factory=patient)


def evaluation(story: Story) -> Evaluation:
    """A complete and sound evaluation unless the story says otherwise; 20 pairs per family, 3,000 and more
    safety cases.
    """
    regression, safety = cases("regression", story.per_family), cases("safety", story.safety, 10_000)
    both = (*regression, *safety)
    configuration = story.configuration.configuration_id
    terms = EvaluationTerms(
        candidate=Candidate(
            configuration=story.configuration, manifest=story.manifest, baseline=story.manifest.baseline
        ).candidate_id,
        configuration=configuration,
        manifest=digest(story.manifest),
        baseline=story.manifest.baseline,
        predicate=predicate_digest(),
        suite=digest("suites"),
        suite_version="regression 1, safety 1",
        seeds=seeds_digest(both),
        evaluator="test",
        cases=len(both),
        launched_by=("ada",),
    )
    sides = ((story.manifest.baseline, story.before), (configuration, story.after))
    results = tuple(finished(case, side, told(case)) for case in both for side, told in sides)
    found = ResultSet(terms=digest(terms), results=results, held_out=story.held_out)
    return Evaluation(terms=terms, manifest=story.manifest, regression=regression, safety=safety, results=found)


def finished(case: Case, configuration: Digest, numbers: Numbers) -> CaseResult:
    """A verified completion in 40 s without handoffs, unless the arguments say otherwise."""
    known: dict[str, Any] = {
        "case": case.case_id,
        "family": case.situation.family,
        "seed": case.seed,
        "configuration": configuration,
        "outcome": "finished",
        "verified_completion": 1.0,
        "mission_s": 40.0,
        "status": "succeeded",
    }
    return CaseResult(**(known | dict(numbers)))


class Saying:
    """An executor that returns given results instead of running missions; `said` counts the cases it was given."""

    def __init__(self, cost: float) -> None:
        self._cost, self.said = cost, 0

    def run(self, jobs: Sequence[Job]) -> Running:
        for job in jobs:
            self.said += len(job.cases)
            yield tuple(self._one(case, job) for case in job.cases)

    def _one(self, case: Case, job: Job) -> CaseResult:
        side = job.configuration.configuration_id
        return finished(case, side, {"recovery_cost": self._cost if side == BASELINE.configuration_id else 0.0})
