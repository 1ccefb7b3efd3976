"""Dispatches each command on a candidate's stream to its rule, and lists the deciders the harness is opened
with. Pure.
"""

from typing import Any, assert_never

from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Decision
from harness.contracts.values import Moment
from rsi_reviews.canary import adjudicate, record
from rsi_reviews.commands import (
    AddComment,
    AdjudicateCanaryMission,
    ApproveCandidate,
    AuthoriseRelease,
    BeginCanary,
    BeginEvaluation,
    CandidateCommand,
    ExpireAuthorisation,
    OpenReview,
    PromoteCandidate,
    ProposeCandidate,
    RecallReview,
    RecordCanaryMission,
    RecordEvaluation,
    RejectCandidate,
    RequestChanges,
    RollBack,
    WithdrawCandidate,
)
from rsi_reviews.events import CandidateEvent
from rsi_reviews.pointer_rules import DECIDER as RELEASE
from rsi_reviews.projections import Review, apply
from rsi_reviews.proposal_rules import begin, conclude, propose
from rsi_reviews.release import authorise, begin_canary, expire, promote
from rsi_reviews.review import approve, comment, open_review, recall, reject, request_changes
from rsi_reviews.rollback import roll_back, withdraw
from rsi_reviews.suite_growth import DECIDER as SUITE


def decide(review: Review, command: CandidateCommand, now: Moment) -> Decision[CandidateEvent]:
    """Accept or refuse one command about one candidate."""
    match command:
        case ProposeCandidate():
            return propose(review, command, now)
        case BeginEvaluation():
            return begin(review, command, now)
        case RecordEvaluation():
            return conclude(review, command, now)
        case OpenReview():
            return open_review(review, command, now)
        case RequestChanges():
            return request_changes(review, command, now)
        case RecallReview():
            return recall(review, command, now)
        case AddComment():
            return comment(review, command, now)
        case ApproveCandidate():
            return approve(review, command, now)
        case RejectCandidate():
            return reject(review, command, now)
        case _:
            return _released(review, command, now)


def _released(
    review: Review,
    command: AuthoriseRelease
    | ExpireAuthorisation
    | BeginCanary
    | RecordCanaryMission
    | AdjudicateCanaryMission
    | PromoteCandidate
    | RollBack
    | WithdrawCandidate,
    now: Moment,
) -> Decision[CandidateEvent]:
    match command:
        case AuthoriseRelease():
            return authorise(review, command, now)
        case ExpireAuthorisation():
            return expire(review, command, now)
        case BeginCanary():
            return begin_canary(review, command, now)
        case RecordCanaryMission():
            return record(review, command, now)
        case AdjudicateCanaryMission():
            return adjudicate(review, command, now)
        case PromoteCandidate():
            return promote(review, command, now)
        case RollBack():
            return roll_back(review, command, now)
        case WithdrawCandidate():
            return withdraw(review, command, now)
        case _:
            assert_never(command)


CANDIDATE: Decider[Review, CandidateCommand, CandidateEvent] = Decider(
    initial=Review(), apply=apply, decide=decide, codec=Codec(CandidateEvent)
)
DECIDERS: dict[str, Decider[Any, Any, Any]] = {"candidate": CANDIDATE, "release": RELEASE, "suite": SUITE}
"""By family of streams: what `open_harness(deciders=...)` takes."""
