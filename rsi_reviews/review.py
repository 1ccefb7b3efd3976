"""Decides what people may do to a candidate in review, bound to exactly what they were shown (gate 2, D33). Pure."""

from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment, digest
from rsi_reviews import approval_policy, commands, events
from rsi_reviews.contracts import ReleasePolicy, Subject
from rsi_reviews.projections import Review

WORDS = ("changes_requested", "rejected", "authorised", "canary_begun", "rolled_back", "withdrawn", "recalled")
"""Words after which an earlier question is answered."""


def open_review(review: Review, command: commands.OpenReview, now: Moment) -> Decision[events.CandidateEvent]:
    """Ask people to review, in a new cycle: approvals of an earlier one are void."""
    if (again := approval_policy.repeated(command, review.receipts)) is not None:
        return again
    terms, evaluation = review.terms, review.evaluation
    if review.status != "accepted" or terms is None or evaluation is None:
        return refused("not_accepted", status=review.status)
    subject = Subject(
        candidate=review.candidate,
        configuration=review.configuration,
        manifest=review.manifest_digest,
        baseline=review.baseline,
        predicate=terms.predicate,
        suite=terms.suite,
        seeds=terms.seeds,
        evaluator=terms.evaluator,
        result_set=evaluation.result_set,
        report=evaluation.report_digest,
    )
    opened = events.ReviewOpened(
        cycle=review.cycle + 1, subject=subject, subject_digest=digest(subject), by=approval_policy.signed(command, now)
    )
    return Accepted((opened,))


def comment(review: Review, command: commands.AddComment, now: Moment) -> Decision[events.CandidateEvent]:
    """Record a comment, which changes nothing else."""
    if (again := approval_policy.repeated(command, review.receipts)) is not None:
        return again
    if not review.version:
        return refused("no_candidate", because("no_such_candidate"))
    return Accepted((events.CommentAdded(cycle=review.cycle, by=approval_policy.signed(command, now)),))


def recall(review: Review, command: commands.RecallReview, now: Moment) -> Decision[events.CandidateEvent]:
    """Withdraw from review, by its own authors, while nobody has authorised it."""
    if (again := approval_policy.repeated(command, review.receipts)) is not None:
        return again
    if review.status != "in_review":
        return answered(review)
    if command.actor.name not in review.authors:
        return refused("not_an_author", actor=command.actor.name)
    return Accepted((events.ReviewRecalled(cycle=review.cycle, by=approval_policy.signed(command, now)),))


def request_changes(review: Review, command: commands.RequestChanges, now: Moment) -> Decision[events.CandidateEvent]:
    """Return to its authors. It is reviewed again in a new cycle, and every approval is void."""
    refusal = unanswerable(review, command) or approval_policy.not_a_person(command.actor, approval_policy.REVIEWERS)
    return refusal or Accepted((events.ChangesRequested(cycle=review.cycle, by=approval_policy.signed(command, now)),))


def reject(review: Review, command: commands.RejectCandidate, now: Moment) -> Decision[events.CandidateEvent]:
    """Reject for good: another candidate may follow, this one cannot be submitted again."""
    refusal = unanswerable(review, command) or approval_policy.not_a_person(command.actor, approval_policy.REVIEWERS)
    rejected = events.CandidateRejected(
        cycle=review.cycle, subject=command.subject, by=approval_policy.signed(command, now)
    )
    return refusal or Accepted((rejected,))


def approve(review: Review, command: commands.ApproveCandidate, now: Moment) -> Decision[events.CandidateEvent]:
    """Record one person's approval of exactly this subject in this cycle. An author's own counts only where the policy
    says so.
    """
    refusal = unanswerable(review, command) or approval_policy.not_a_person(command.actor, approval_policy.REVIEWERS)
    if refusal:
        return refusal
    own = command.actor.name in review.authors
    if own and (refusal := own_word(review, command, command.policy, now)):
        return refusal
    if any(earlier.actor.name == command.actor.name for earlier in review.approvals):
        return refused("approved_already", actor=command.actor.name)
    by = approval_policy.signed(command, now, override=own)
    return Accepted((events.CandidateApproved(cycle=review.cycle, subject=command.subject, by=by),))


def own_word(review: Review, command: commands.ReviewCommand, policy: ReleasePolicy, now: Moment) -> Refused | None:
    """An author decides on their own candidate only under the single-operator policy, after its cooling-off time."""
    who = command.actor.name
    if policy.kind != "single_operator":
        parts = tuple(sorted({hand.part for hand in review.hands if hand.name == who}))
        return refused("own_candidate", actor=who, parts=parts)
    if review.evaluation is None or now.wall_s < review.evaluation.by.at_s + policy.cooling_off_s:
        since = review.evaluation.by.at_s + policy.cooling_off_s if review.evaluation else now.wall_s
        return refused("cooling_off", because("cooling_off_until", until_s=since))
    return None


def unanswerable(
    review: Review, command: commands.OnSubject, *, status: str = "in_review"
) -> Decision[events.CandidateEvent] | None:
    """The same receipt for the same request; a refusal if the question is answered, has changed or is another one."""
    if (again := approval_policy.repeated(command, review.receipts)) is not None:
        return again
    if review.status != status:
        return answered(review)
    if command.cycle != review.cycle:
        return refused("wrong_cycle", cycle=review.cycle, shown_cycle=command.cycle)
    if command.subject != review.subject_digest:
        return refused("wrong_digest", because("release_changed"))
    return None


def answered(review: Review) -> Refused:
    """Who decided what, and when."""
    last = next((entry for entry in reversed(review.said) if entry.what in WORDS), None)
    if last is None:
        return refused("not_open", because("candidate_not_asked", status=review.status))
    decided = because(
        "candidate_decided",
        actor=last.by.actor.name,
        decision=last.what,
        at_s=last.by.at_s,
        reason=last.by.reason,
        status=review.status,
    )
    return refused("decided", decided)
