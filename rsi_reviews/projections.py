"""Folds a candidate's stream into the present state of its review. Pure: reads no clock, decides nothing."""

from typing import Literal, assert_never

import msgspec
from msgspec.structs import replace

from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Value
from rsi_reviews import contracts, events

Status = Literal[
    "none", "draft", "evaluating", "accepted", "rejected", "inconclusive", "in_review", "authorised", "canary",
    "current", "rolled_back", "withdrawn",
]  # fmt: skip
ENDED: frozenset[str] = frozenset({"rejected", "rolled_back", "withdrawn"})
Part = Literal["proposed", "wrote_earlier", "launched", "edited_suite"]


class Hand(Value):
    """Somebody who took part in the candidate as an author, and so may not approve it (D33)."""

    name: Name
    part: Part
    person: bool = True


class CanaryEntry(Value):
    """One canary mission: what was measured, and the finding of somebody other than the releaser."""

    measured: contracts.CanaryMission
    finding: contracts.Finding | None = None
    by: events.Signed | None = None


class ReviewEntry(Value):
    """One entry of the review's history: what was done, in which cycle."""

    what: Name
    cycle: Count
    by: events.Signed


class Review(Value):
    """Everything about one candidate. `receipts` are the signed requests by key."""

    version: Count = 0
    status: Status = "none"
    candidate: Digest = Digest("")
    configuration: Digest = Digest("")
    manifest: contracts.Manifest | None = None
    manifest_digest: Digest = Digest("")
    baseline: Digest = Digest("")
    sections: tuple[contracts.Section, ...] = ()
    supersedes: Digest | None = None
    hands: tuple[Hand, ...] = ()
    terms: contracts.EvaluationTerms | None = None
    evaluation: events.EvaluationRecorded | None = None
    cycle: Count = 0
    subject: contracts.Subject | None = None
    subject_digest: Digest = Digest("")
    approvals: tuple[events.Signed, ...] = ()
    authorised: events.ReleaseAuthorised | None = None
    robot_id: RobotId | None = None
    released_by: events.Signed | None = None
    bound: float = 0.0
    bound_missions: Count = 0
    canary: tuple[CanaryEntry, ...] = ()
    said: tuple[ReviewEntry, ...] = ()
    receipts: dict[str, events.Signed] = msgspec.field(default_factory=dict)
    ended_reason: Explanation = ""

    @property
    def authors(self) -> frozenset[str]:
        return frozenset(hand.name for hand in self.hands)

    @property
    def unanswered(self) -> bool:
        """Whether its evaluation ended in an error: it may be repeated under the same terms."""
        return self.status == "inconclusive" and self.evaluation is not None and self.evaluation.answer == "error"

    @property
    def evaluable(self) -> bool:
        """Whether an evaluation may begin, or begin again."""
        return self.status in ("draft", "evaluating") or self.unanswered

    @property
    def exercised(self) -> tuple[CanaryEntry, ...]:
        """Canary missions in which the change took a part."""
        return tuple(entry for entry in self.canary if entry.measured.exercised)

    def entry(self, mission_id: MissionId) -> CanaryEntry | None:
        return next((entry for entry in self.canary if entry.measured.mission_id == mission_id), None)


def apply(review: Review, event: events.CandidateEvent) -> Review:
    """The review after one event."""
    review = replace(review, version=review.version + 1)
    match event:
        case events.CandidateProposed() | events.EvaluationBegun() | events.EvaluationRecorded():
            return _with_evaluation(review, event)
        case events.ReviewOpened():
            return _with_entry(
                replace(
                    review,
                    status="in_review",
                    cycle=event.cycle,
                    subject=event.subject,
                    subject_digest=event.subject_digest,
                    approvals=(),
                ),
                "review_opened",
                event.by,
            )
        case events.ChangesRequested():
            return _with_entry(replace(review, status="accepted", approvals=()), "changes_requested", event.by)
        case events.ReviewRecalled():
            return _with_entry(replace(review, status="accepted", approvals=()), "recalled", event.by)
        case events.CommentAdded():
            return _with_entry(review, "commented", event.by)
        case events.CandidateApproved():
            return _with_entry(replace(review, approvals=(*review.approvals, event.by)), "approved", event.by)
        case events.CandidateRejected():
            return _with_entry(replace(review, status="rejected", ended_reason=event.by.reason), "rejected", event.by)
        case events.ReleaseAuthorised():
            return _with_entry(replace(review, status="authorised", authorised=event), "authorised", event.by)
        case events.AuthorisationExpired():
            return replace(review, status="accepted", authorised=None, approvals=())
        case _:
            return _released(review, event)


def _with_evaluation(
    review: Review, event: events.CandidateProposed | events.EvaluationBegun | events.EvaluationRecorded
) -> Review:
    match event:
        case events.CandidateProposed():
            author = event.manifest.author
            named = Hand(name=author.name, part="proposed", person=author.kind == "person")
            earlier = [Hand(name=name, part="wrote_earlier") for name in event.earlier]
            proposer = Hand(name=event.by.actor.name, part="proposed", person=event.by.actor.channel == "human")
            proposed = replace(
                review,
                status="draft",
                candidate=event.candidate,
                configuration=event.configuration,
                manifest=event.manifest,
                manifest_digest=event.manifest_digest,
                baseline=event.baseline,
                sections=event.sections,
                supersedes=event.supersedes,
                hands=_joined((), named, proposer, *earlier),
            )
            return _with_entry(proposed, "proposed", event.by)
        case events.EvaluationBegun():
            hands = [Hand(name=name, part="launched") for name in event.terms.launched_by]
            hands += [Hand(name=name, part="edited_suite") for name in event.terms.suite_edited_by]
            following = replace(review, status="evaluating", terms=event.terms, hands=_joined(review.hands, *hands))
            return _with_entry(following, "evaluation_begun", event.by)
        case events.EvaluationRecorded():
            statuses: dict[str, Status] = {"pass": "accepted", "fail": "rejected"}
            status = statuses.get(event.answer, "inconclusive")
            return _with_entry(replace(review, status=status, evaluation=event), "evaluated", event.by)
        case _:
            assert_never(event)


def _released(
    review: Review,
    event: events.CanaryBegun
    | events.CanaryMissionRecorded
    | events.CanaryMissionAdjudicated
    | events.CandidateReleased
    | events.CandidateRolledBack
    | events.CandidateWithdrawn,
) -> Review:
    match event:
        case events.CanaryBegun():
            following = replace(
                review,
                status="canary",
                robot_id=event.robot_id,
                released_by=event.by,
                bound=event.bound,
                bound_missions=event.bound_missions,
            )
            return _with_entry(following, "canary_begun", event.by)
        case events.CanaryMissionRecorded():
            return replace(review, canary=(*review.canary, CanaryEntry(measured=event.measured)))
        case events.CanaryMissionAdjudicated():
            entries = tuple(
                replace(entry, finding=event.finding, by=event.by)
                if entry.measured.mission_id == event.mission_id
                else entry
                for entry in review.canary
            )
            return _with_entry(replace(review, canary=entries), "adjudicated", event.by)
        case events.CandidateReleased():
            return replace(review, status="current", ended_reason=event.reason)
        case events.CandidateRolledBack():
            return _with_entry(
                replace(review, status="rolled_back", ended_reason=event.reason), "rolled_back", event.by
            )
        case events.CandidateWithdrawn():
            return _with_entry(replace(review, status="withdrawn", ended_reason=event.reason), "withdrawn", event.by)
        case _:
            assert_never(event)


def _with_entry(review: Review, what: str, by: events.Signed) -> Review:
    entry = ReviewEntry(what=what, cycle=review.cycle, by=by)
    return replace(review, said=(*review.said, entry), receipts={**review.receipts, by.key: by})


def _joined(hands: tuple[Hand, ...], *more: Hand) -> tuple[Hand, ...]:
    """Each (name, part) once. An author who is an optimiser stays one when it also launches the evaluation."""
    machines = {hand.name for hand in (*hands, *more) if not hand.person}
    merged: dict[tuple[str, Part], Hand] = {(hand.name, hand.part): hand for hand in hands}
    for hand in more:
        merged.setdefault((hand.name, hand.part), replace(hand, person=hand.name not in machines))
    return tuple(merged.values())
