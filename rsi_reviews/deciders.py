"""Dispatches each command on a candidate's stream to its rule, and lists the deciders the harness is opened
with. Pure.
"""

from typing import Any, assert_never

from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Decision
from harness.contracts.values import Moment
from rsi_reviews import commands
from rsi_reviews.canary import adjudicate, record
from rsi_reviews.events import CandidateEvent
from rsi_reviews.pointer_rules import DECIDER as RELEASE
from rsi_reviews.projections import Review, apply
from rsi_reviews.proposal_rules import begin, conclude, propose
from rsi_reviews.refused_proposals import DECIDER as REFUSED
from rsi_reviews.release import authorise, begin_canary, expire, promote
from rsi_reviews.review import approve, comment, open_review, recall, reject, request_changes
from rsi_reviews.rollback import roll_back, withdraw
from rsi_reviews.suite_growth import DECIDER as SUITE


def decide(review: Review, command: commands.CandidateCommand, now: Moment) -> Decision[CandidateEvent]:
    """Accept or refuse one command about one candidate."""
    match command:
        case commands.ProposeCandidate():
            return propose(review, command, now)
        case commands.BeginEvaluation():
            return begin(review, command, now)
        case commands.RecordEvaluation():
            return conclude(review, command, now)
        case commands.OpenReview():
            return open_review(review, command, now)
        case commands.RequestChanges():
            return request_changes(review, command, now)
        case commands.RecallReview():
            return recall(review, command, now)
        case commands.AddComment():
            return comment(review, command, now)
        case commands.ApproveCandidate():
            return approve(review, command, now)
        case commands.RejectCandidate():
            return reject(review, command, now)
        case _:
            return _released(review, command, now)


def _released(
    review: Review,
    command: commands.AuthoriseRelease
    | commands.ExpireAuthorisation
    | commands.BeginCanary
    | commands.RecordCanaryMission
    | commands.AdjudicateCanaryMission
    | commands.PromoteCandidate
    | commands.RollBack
    | commands.WithdrawCandidate,
    now: Moment,
) -> Decision[CandidateEvent]:
    match command:
        case commands.AuthoriseRelease():
            return authorise(review, command, now)
        case commands.ExpireAuthorisation():
            return expire(review, command, now)
        case commands.BeginCanary():
            return begin_canary(review, command, now)
        case commands.RecordCanaryMission():
            return record(review, command, now)
        case commands.AdjudicateCanaryMission():
            return adjudicate(review, command, now)
        case commands.PromoteCandidate():
            return promote(review, command, now)
        case commands.RollBack():
            return roll_back(review, command, now)
        case commands.WithdrawCandidate():
            return withdraw(review, command, now)
        case _:
            assert_never(command)


CANDIDATE: Decider[Review, commands.CandidateCommand, CandidateEvent] = Decider(
    initial=Review(), apply=apply, decide=decide, codec=Codec(CandidateEvent)
)
DECIDERS: dict[str, Decider[Any, Any, Any]] = {
    "candidate": CANDIDATE, "release": RELEASE, "suite": SUITE, "refused": REFUSED,
}  # fmt: skip
"""By family of streams: what `open_harness(deciders=...)` takes."""
