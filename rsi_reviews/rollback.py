"""Decides rollbacks, which return to the accepted version at once without an evaluation, and withdrawals without a
fault. Pure.
"""

from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Decision
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Moment
from rsi_reviews.approval_policy import RELEASERS, not_a_person, repeated, signed
from rsi_reviews.canary import fault_in, outcome
from rsi_reviews.commands import RollBack, WithdrawCandidate
from rsi_reviews.events import CandidateEvent, CandidateRolledBack, CandidateWithdrawn
from rsi_reviews.projections import Review
from rsi_reviews.review import answered

DESK = Actor(name="review-desk", role="desk", channel="policy")
"""Who acts when a canary's own rule does, fixed before it began."""


def roll_back(review: Review, command: RollBack, now: Moment) -> Decision[CandidateEvent]:
    """Pre-authorised: by a releaser with a reason, or by the canary's rule. The configuration is quarantined."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if review.status not in ("canary", "current"):
        return answered(review)
    by_rule = command.actor == DESK and outcome(review) in ("hard_fault", "metric_worse")
    if not by_rule and (refusal := not_a_person(command.actor, RELEASERS)):
        return refusal
    return Accepted((CandidateRolledBack(reason=command.reason, by=signed(command, now)),))


def withdraw(review: Review, command: WithdrawCandidate, now: Moment) -> Decision[CandidateEvent]:
    """Without a fault, so without quarantine: by an author or a releaser, or because nothing exercised the change."""
    if (again := repeated(command, review.receipts)) is not None:
        return again
    if not review.version or review.status in ("current", "rejected", "rolled_back", "withdrawn"):
        return answered(review)
    may = command.actor == DESK or command.actor.name in review.authors
    refusal = None if may else not_a_person(command.actor, RELEASERS)
    return refusal or Accepted((CandidateWithdrawn(reason=command.reason, by=signed(command, now)),))


def why(review: Review) -> Reason:
    """The reason by the canary's own rule."""
    if found := fault_in(review.canary):
        fault, mission_id = found
        return because("canary_hard_fault", fault=fault, mission_id=mission_id)
    worse = sum(entry.measured.worse for entry in review.exercised)
    metric = review.manifest.metric if review.manifest else "metric"
    return because("canary_metric_worse", metric=metric, worse=worse, exercised=len(review.exercised))
