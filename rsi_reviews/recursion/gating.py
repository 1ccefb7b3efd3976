"""Takes one candidate through the gate: static check, regression suite on the fleet's site, acceptance predicate,
held-out look.

The predicate is the one of the release service, with smaller numbers, which are written into every result.
"""

from collections.abc import Callable, Sequence

from msgspec.structs import replace

from harness.contracts.configuration import Configuration
from harness.contracts.reasons import plain
from harness.contracts.regularities import HiddenSite
from harness.contracts.values import Count, Value, digest
from rsi_reviews import contracts
from rsi_reviews.acceptance import Evaluation, Predicate, accepted, predicate_digest
from rsi_reviews.held_out import Look, Secret, answered, held_out_cases
from rsi_reviews.manifest import unfounded
from rsi_reviews.recursion.missions import TEMPLATE, Stop, suite_cases
from rsi_reviews.regression.cases import Case, seeds_digest
from rsi_reviews.restrictions import loosened
from rsi_reviews.runnable import unrunnable

EVALUATOR = "recursion-1"
NOT_LOOKED = "the held-out look was not taken"
Run = Callable[[tuple[Case, ...], Configuration, Stop | None], tuple[contracts.CaseResult, ...]]
"""Runs a series of cases under a configuration, or knows what came of it before; a stop may cut it short."""


class Scale(Value):
    """The gate's sample sizes here; the release service takes 20 pairs per family and 3,000 safety cases.

    A change under which none of the first `first_look` missions takes another course is refused as unexercised.
    """

    per_family: Count = 4
    held_out_per_family: Count = 3
    first_look: Count = 10

    @property
    def predicate(self) -> Predicate:
        """The acceptance predicate with these numbers."""
        return Predicate(pairs_per_family=self.per_family, safety_cases=5 * self.per_family)


class GateJudgement(Value):
    """The gate's answer on one candidate: accepted, or refused by which clause and why, and the missions it took."""

    candidate: str
    component: str
    reason: str
    metric: str
    accepted: bool
    clause: str
    sentence: str
    missions: Count


class SiteGate:
    """The gate of one fleet. Looks are counted, so that alpha is spent over all of them (D32)."""

    def __init__(self, run: Run, *, secret: Secret, scale: Scale, key: str) -> None:
        self._run, self._secret, self._scale, self._key = run, secret, scale, key
        self._looks = 0

    def judge(self, candidate: contracts.Candidate, current: Configuration, site: HiddenSite) -> GateJudgement:
        """Accept or refuse. A candidate that fails an early check runs no further missions."""
        changed = candidate.configuration
        refused = (*loosened(current, changed), *unrunnable(current, changed), *unfounded(candidate, current))
        if refused:
            return judgement(candidate, clause=f"static:{refused[0].rule}", sentence=plain(refused[0].reason))
        cases = suite_cases(site, self._key, "regression", per_family=self._scale.per_family)
        before = self._run(cases, current, None)
        after = self._run(cases, candidate.configuration, lambda done: self._idle(done, before))
        taken = len(before) + len(after)
        if len(after) < len(cases):
            sentence = f"The first {len(after)} missions all went the same way as under the baseline."
            return judgement(candidate, clause="unexercised", sentence=sentence, missions=taken)
        results = (*before, *after)
        report = accepted(self._evaluation(candidate, cases, results, held_out=None), self._scale.predicate)
        broken = _broken(report)
        if broken is not None:
            return judgement(
                candidate, clause=f"{broken.clause}:{broken.answer}", sentence=broken.sentence, missions=taken
            )
        answer, looked = self._look(candidate, current, site)
        evaluation = self._evaluation(candidate, cases, results, held_out=answer)
        last = accepted(evaluation, self._scale.predicate).clauses[-1]
        return judgement(
            candidate,
            clause="" if last.answer == "pass" else f"{last.clause}:held_out",
            sentence=last.sentence,
            missions=taken + looked,
        )

    def _idle(self, done: Sequence[contracts.CaseResult], before: Sequence[contracts.CaseResult]) -> bool:
        """Whether a change had no effect by the first look."""
        first = self._scale.first_look
        return len(done) == first and [one.trace for one in done] == [one.trace for one in before[:first]]

    def _evaluation(
        self,
        candidate: contracts.Candidate,
        cases: tuple[Case, ...],
        results: tuple[contracts.CaseResult, ...],
        *,
        held_out: contracts.HeldOutAnswer | None,
    ) -> Evaluation:
        terms = contracts.EvaluationTerms(
            candidate=candidate.candidate_id,
            configuration=candidate.configuration.configuration_id,
            manifest=digest(candidate.manifest),
            baseline=candidate.baseline,
            predicate=predicate_digest(self._scale.predicate),
            suite=seeds_digest(cases),
            suite_version="1",
            seeds=seeds_digest(cases),
            evaluator=EVALUATOR,
            cases=len(cases),
            launched_by=(EVALUATOR,),
        )
        found = contracts.ResultSet(terms=digest(terms), results=results, held_out=held_out)
        return Evaluation(terms=terms, manifest=candidate.manifest, regression=cases, safety=(), results=found)

    def _look(
        self, candidate: contracts.Candidate, current: Configuration, site: HiddenSite
    ) -> tuple[contracts.HeldOutAnswer, int]:
        """One look on cases that are drawn only now, from the secret and the candidate's digest."""
        self._looks += 1
        identity, manifest = candidate.candidate_id, candidate.manifest
        look = Look(candidate=identity, manifest=digest(manifest), look=self._looks)
        drawn = held_out_cases(self._secret, identity, per_family=self._scale.held_out_per_family, site=site)
        cases = tuple(replace(one, situation=replace(one.situation, template=TEMPLATE)) for one in drawn)
        results = (*self._run(cases, current, None), *self._run(cases, candidate.configuration, None))
        answer = answered(look, manifest, cases, results, candidate.configuration.configuration_id)
        return answer, 2 * len(cases)


def _broken(report: contracts.AcceptanceReport) -> contracts.ClauseAnswer | None:
    """The first clause that already refuses without a held-out look."""
    refused = [one for one in report.clauses if one.answer in ("fail", "error")]
    unsure = [one for one in report.clauses if one.answer == "inconclusive" and NOT_LOOKED not in one.sentence]
    return next(iter([*refused, *unsure]), None)


def judgement(candidate: contracts.Candidate, *, clause: str, sentence: str, missions: int = 0) -> GateJudgement:
    """Refused by `clause`; accepted where it is empty."""
    return GateJudgement(
        candidate=candidate.candidate_id,
        component=candidate.manifest.component,
        reason=f"{candidate.manifest.reason} {candidate.manifest.intended_effect}",
        metric=candidate.manifest.metric,
        accepted=not clause,
        clause=clause or "accepted",
        sentence=sentence,
        missions=missions,
    )
