"""Pure: what persons may say about a candidate in review, bound to exactly what they were shown (gate 2, D33)."""

from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.values import Moment, digest
from rsi_reviews.commands import (
    AddComment,
    ApproveCandidate,
    OnSubject,
    OpenReview,
    RecallReview,
    RejectCandidate,
    RequestChanges,
    Word,
)
from rsi_reviews.contracts import ReleasePolicy, Subject
from rsi_reviews.events import (
    CandidateApproved,
    CandidateEvent,
    CandidateRejected,
    ChangesRequested,
    CommentAdded,
    ReviewOpened,
    ReviewRecalled,
)
from rsi_reviews.projections import Review
from rsi_reviews.signing import REVIEWERS, instant, not_a_person, repeated, signed

WORDS = ("changes_requested", "rejected", "authorised", "canary_begun", "rolled_back", "withdrawn", "recalled")
"""Words after which an earlier question is answered."""


def open_review(review: Review, command: OpenReview, now: Moment) -> Decision[CandidateEvent]:
    """Ask persons, in a new cycle: approvals of an earlier one are void."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    terms, evaluation = review.terms, review.evaluation
    if review.status != "accepted" or terms is None or evaluation is None:
        return Refused("not_accepted", f"The candidate is {review.status}; only an accepted one is reviewed.")
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
    opened = ReviewOpened(
        cycle=review.cycle + 1, subject=subject, subject_digest=digest(subject), by=signed(command, now)
    )
    return Accepted((opened,))


def comment(review: Review, command: AddComment, now: Moment) -> Decision[CandidateEvent]:
    """A comment changes nothing else, and stays."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if not review.version:
        return Refused("no_candidate", "There is no such candidate.")
    return Accepted((CommentAdded(cycle=review.cycle, by=signed(command, now)),))


def recall(review: Review, command: RecallReview, now: Moment) -> Decision[CandidateEvent]:
    """Its own authors may take it back while nobody has authorised it."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if review.status != "in_review":
        return answered(review)
    if command.actor.name not in review.authors:
        return Refused("not_an_author", f"{command.actor.name} is no author of it; request changes or reject it.")
    return Accepted((ReviewRecalled(cycle=review.cycle, by=signed(command, now)),))


def request_changes(review: Review, command: RequestChanges, now: Moment) -> Decision[CandidateEvent]:
    """Back to its authors. It comes again in a new cycle, and every approval is void."""
    refused = unanswerable(review, command) or not_a_person(command.actor, REVIEWERS)
    return refused or Accepted((ChangesRequested(cycle=review.cycle, by=signed(command, now)),))


def reject(review: Review, command: RejectCandidate, now: Moment) -> Decision[CandidateEvent]:
    """For good: another candidate may follow, this one does not come again."""
    refused = unanswerable(review, command) or not_a_person(command.actor, REVIEWERS)
    rejected = CandidateRejected(cycle=review.cycle, subject=command.subject, by=signed(command, now))
    return refused or Accepted((rejected,))


def approve(review: Review, command: ApproveCandidate, now: Moment) -> Decision[CandidateEvent]:
    """One person's yes to exactly this subject in this cycle. An author's own counts only where the policy says so."""
    refused = unanswerable(review, command) or not_a_person(command.actor, REVIEWERS)
    if refused:
        return refused
    own = command.actor.name in review.authors
    if own and (refused := own_word(review, command, command.policy, now)):
        return refused
    if any(earlier.actor.name == command.actor.name for earlier in review.approvals):
        return Refused("approved_already", f"{command.actor.name} approved it in this cycle.")
    by = signed(command, now, override=own)
    return Accepted((CandidateApproved(cycle=review.cycle, subject=command.subject, by=by),))


def own_word(review: Review, command: Word, policy: ReleasePolicy, now: Moment) -> Refused | None:
    """An author decides on their own candidate only under the single-operator policy, after its cooling-off time."""
    who = command.actor.name
    if policy.kind != "single_operator":
        parts = ", ".join(sorted({hand.part for hand in review.hands if hand.name == who}))
        return Refused("own_candidate", f"{who} is an author of it ({parts}); somebody else decides.")
    if review.evaluation is None or now.wall_s < review.evaluation.by.at_s + policy.cooling_off_s:
        since = review.evaluation.by.at_s + policy.cooling_off_s if review.evaluation else now.wall_s
        return Refused("cooling_off", f"A single operator waits: not before {instant(since)}.")
    return None


def unanswerable(review: Review, command: OnSubject, *, status: str = "in_review") -> Decision[CandidateEvent] | None:
    """The same receipt for the same word; a refusal if the question is answered, has changed or is another one."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if review.status != status:
        return answered(review)
    if command.cycle != review.cycle:
        return Refused("wrong_cycle", f"The question changed: it is in cycle {review.cycle}, not {command.cycle}.")
    if command.subject != review.subject_digest:
        return Refused("wrong_digest", "What would be released is not what you saw. Read it again, then decide.")
    return None


def answered(review: Review) -> Refused:
    """Who decided what, and when."""
    last = next((said for said in reversed(review.said) if said.what in WORDS), None)
    if last is None:
        return Refused("not_open", f"The candidate is {review.status}; this is not asked now.")
    who, when = last.by.actor.name, instant(last.by.at_s)
    word = last.what.replace("_", " ")
    return Refused("decided", f"{who}: {word} at {when}, “{last.by.reason}”. The candidate is {review.status}.")
