"""Decides whether a candidate may be proposed and evaluated, and whether results count. Pure. Terms come before
results, always (D31).
"""

from math import isfinite

from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment, digest
from rsi_reviews import contracts
from rsi_reviews.approval_policy import repeated, signed
from rsi_reviews.canary import bound_of
from rsi_reviews.commands import BeginEvaluation, ProposeCandidate, RecordEvaluation
from rsi_reviews.events import CandidateEvent, CandidateProposed, EvaluationBegun, EvaluationRecorded
from rsi_reviews.manifest import sections_changed
from rsi_reviews.projections import ENDED, Review
from rsi_reviews.static_check import objections


def propose(review: Review, command: ProposeCandidate, now: Moment) -> Decision[CandidateEvent]:
    """Record the candidate with its manifest, or refuse with the rule that the first flaw or loosening breaks."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    candidate, baseline = command.candidate, command.baseline
    if review.version:
        return refused("exists", because("candidate_exists", status=review.status))
    found = objections(candidate, baseline)
    if found:
        return refused_for(found)
    proposed = CandidateProposed(
        candidate=candidate.candidate_id,
        configuration=candidate.configuration.configuration_id,
        manifest=candidate.manifest,
        manifest_digest=digest(candidate.manifest),
        baseline=candidate.baseline,
        sections=sections_changed(baseline, candidate.configuration),
        by=signed(command, now),
        supersedes=command.supersedes,
        earlier=command.earlier,
    )
    return Accepted((proposed,))


def refused_for(found: tuple[contracts.RestrictionViolation, ...]) -> Refused:
    """One refusal that names the first rule and counts the rest."""
    first = found[0]
    change = {"old": first.old or "-", "new": first.new or "-"} if first.old or first.new else {}
    reason = because(
        "candidate_loosens_value" if change else "candidate_loosens", path=first.path, why=first.reason, **change
    )
    if len(found) > 1:
        reason = because("candidate_loosens_more", first=reason, more=len(found) - 1)
    return refused(first.rule, reason)


def begin(review: Review, command: BeginEvaluation, now: Moment) -> Decision[CandidateEvent]:
    """Fix the terms, once. An evaluation that gave no answer may be repeated under exactly the same terms."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if other := _foreign(review, command.terms):
        return other
    if review.status == "evaluating" and review.terms == command.terms:
        return Accepted(())
    if review.status != "draft" and not review.unanswered:
        return refused("not_a_draft", status=review.status)
    if review.unanswered and review.terms != command.terms:
        return refused("other_terms", because("terms_fixed"))
    return Accepted(
        (EvaluationBegun(terms=command.terms, terms_digest=digest(command.terms), by=signed(command, now)),)
    )


def _foreign(review: Review, terms: contracts.EvaluationTerms) -> Refused | None:
    """Terms that concern something else than this candidate."""
    if not review.version or review.status in ENDED:
        return refused("no_candidate", because("no_candidate_to_evaluate", status=review.status))
    for rule, name, own in (
        ("other_candidate", "candidate", review.candidate),
        ("other_configuration", "configuration", review.configuration),
        ("other_manifest", "manifest", review.manifest_digest),
        ("other_baseline", "baseline", review.baseline),
    ):
        given = getattr(terms, name)
        if given != own:
            return refused(rule, because("terms_name_another", field=name, given=given[:12], own=own[:12]))
    return None


def conclude(review: Review, command: RecordEvaluation, now: Moment) -> Decision[CandidateEvent]:
    """Accept results if they are complete and were made under the terms that were fixed before."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    manifest, terms = review.manifest, review.terms
    if review.status != "evaluating" or terms is None or manifest is None:
        return refused("not_evaluating", status=review.status)
    if refusal := _other_terms(terms, command) or _broken(terms, command):
        return refusal
    own = [result for result in command.results.results if result.configuration == terms.baseline]
    values = [float(getattr(result, manifest.metric)) for result in own if result.outcome == "finished"]
    recorded = EvaluationRecorded(
        terms=digest(terms),
        result_set=digest(command.results),
        report=command.report,
        report_digest=digest(command.report),
        answer=command.report.answer,
        bound=_bound(values, manifest),
        bound_missions=len(values),
        by=signed(command, now),
    )
    return Accepted((recorded,))


def _bound(values: list[float], manifest: contracts.Manifest) -> float:
    """Nothing is worse than the baseline if it has no finished mission: such an evaluation never passes."""
    if not values:
        return 0.0
    return bound_of(values, manifest.canary, contracts.BETTER[manifest.metric])


def _other_terms(terms: contracts.EvaluationTerms, command: RecordEvaluation) -> Refused | None:
    """Names the terms of the results that differ from the fixed ones."""
    for name in terms.__struct_fields__:
        fixed, given = getattr(terms, name), getattr(command.terms, name)
        if fixed != given:
            return refused(
                f"other_{name}", because("terms_differ", field=name, fixed=_short(fixed), given=_short(given))
            )
    if command.results.terms != digest(terms):
        return refused("other_terms", because("results_of_other_terms"))
    if command.report.predicate != terms.predicate:
        return refused("other_predicate")
    if command.report.terms != digest(terms) or command.report.result_set != digest(command.results):
        return refused("other_result_set")
    return None


def _broken(terms: contracts.EvaluationTerms, command: RecordEvaluation) -> Refused | None:
    """Missing, double, unfinished or unmeasured cases: never a pass, whatever the report says.

    JSON has no NaN, so what is not a number cannot be stored even as a failed evaluation.
    """
    results = command.results.results
    for result in results:
        if not _measured(result):
            return refused("not_a_number", because("case_not_a_number", case=result.case[:12]))
    if command.report.answer == "error":
        return None
    pairs = {(result.case, result.configuration) for result in results}
    cases = {result.case for result in results}
    required = {(case, configuration) for case in cases for configuration in (terms.baseline, terms.configuration)}
    if len(cases) != terms.cases or pairs != required or len(results) != len(pairs):
        return refused("missing_cases", results=len(results), cases=len(cases), expected_cases=terms.cases)
    cut = next((result for result in results if result.outcome != "finished"), None)
    if cut is not None:
        return refused("unfinished_case", case=cut.case[:12], outcome=cut.outcome)
    return _unheld(command.report, held_out=command.results.held_out is not None)


def _unheld(report: contracts.AcceptanceReport, *, held_out: bool) -> Refused | None:
    if report.answer == "pass" and not held_out:
        return refused("no_held_out")
    return None


def _measured(result: contracts.CaseResult) -> bool:
    return all(isfinite(getattr(result, metric)) for metric in contracts.BETTER)


def _short(value: object) -> str:
    return str(value)[:24]
