"""Acts on candidates and releases: propose, review, decide, release, roll back, and who must agree."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, StringConstraints

from app.acts import base
from app.i18n.catalogues import N_
from app.views.forms import Wrong
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, MissionId, RobotId
from rsi_reviews import commands
from rsi_reviews.candidates import LARGEST_BYTES
from rsi_reviews.contracts import Finding, ReleasePolicy
from rsi_reviews.release_service import ReleaseService, SeenSubject, SignedBy
from rsi_reviews.suite_growth import AddCase

Answered = Accepted[Any] | Refused
Json = Annotated[str, StringConstraints(min_length=2, max_length=LARGEST_BYTES)]
MOST_PROCESSES = 64
LONGEST_WAIT_S = 30 * 86400.0


class ProposeCandidateAct(base.Act):
    """Put a candidate on record: a configuration and its manifest as JSON texts; `supersedes` is the one it edits."""

    becomes = commands.ProposeCandidate
    configuration: Json
    manifest: Json
    supersedes: base.Text = ""


class AddCaseAct(base.Act):
    """Make a disputed or failed mission a case of the regression suite: every later candidate is run on it too."""

    becomes = AddCase
    reason: base.Reason


class EvaluateCandidateAct(base.ActModel):
    """Evaluate a candidate on this console's machine; 0 `processes`: as many as the console gives a job."""

    sentences: ClassVar[Mapping[str, str]] = {"processes": N_("An evaluation runs on 1 to 64 processes.")}
    processes: Annotated[int, Field(ge=0, le=MOST_PROCESSES)] = 0


class CancelEvaluationAct(base.ActModel):
    """End an evaluation, or take it out of the queue. What was measured is kept."""


class CandidateAct(base.Act):
    """An act on one candidate. The release service adds to its command what stands now: the policy, what is current."""

    verb: ClassVar[str]
    reason: base.Reason
    key: base.Key

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """A page has one key for all of its buttons, so the verb goes with it."""
        key = typed.get("key", "")
        return super().from_form({**typed, "key": f"{cls.verb}:{key}"[:200] if key else ""})

    @abstractmethod
    def ask(self, releases: ReleaseService, candidate: Digest, actor: Actor) -> Answered:
        """Put it to the release service in this person's name."""

    def _by(self, actor: Actor) -> SignedBy:
        return SignedBy(actor=actor, reason=self.reason, key=self.key)


class _StatedAct(CandidateAct):
    """An act that says why and no more."""

    asks: ClassVar[Callable[[ReleaseService, Digest, SignedBy], Answered]]

    def ask(self, releases: ReleaseService, candidate: Digest, actor: Actor) -> Answered:
        """Raises UnknownName."""
        return type(self).asks(releases, candidate, self._by(actor))


class _SubjectAct(CandidateAct):
    """A decision on exactly what was shown: the review's cycle and the digest of its subject."""

    asks: ClassVar[Callable[[ReleaseService, Digest, SignedBy, SeenSubject], Answered]]
    cycle: base.Count
    subject: base.Sha256

    def ask(self, releases: ReleaseService, candidate: Digest, actor: Actor) -> Answered:
        """Raises UnknownName."""
        return type(self).asks(releases, candidate, self._by(actor), self._seen())

    def _seen(self) -> SeenSubject:
        return SeenSubject(cycle=self.cycle, subject=Digest(self.subject))


class SubmitCandidateAct(_StatedAct):
    """Ask people to review an accepted candidate, in a new cycle."""

    becomes, verb, asks = commands.OpenReview, "submit", ReleaseService.submit


class CommentCandidateAct(_StatedAct):
    """Say something about it; nothing else changes."""

    becomes, verb, asks = commands.AddComment, "comment", ReleaseService.comment


class RecallReviewAct(_StatedAct):
    """End the review: it is accepted and in review no more."""

    becomes, verb, asks = commands.RecallReview, "recall", ReleaseService.recall


class RequestChangesAct(_SubjectAct):
    """Send it back to its authors: every approval is void."""

    becomes, verb, asks = commands.RequestChanges, "request-changes", ReleaseService.request_changes


class ApproveCandidateAct(_SubjectAct):
    """Approve exactly what was shown. An author's own approval is refused."""

    becomes, verb, asks = commands.ApproveCandidate, "approve", ReleaseService.approve


class RejectCandidateAct(_SubjectAct):
    """Refuse it for good."""

    becomes, verb, asks = commands.RejectCandidate, "reject", ReleaseService.reject


class AuthoriseReleaseAct(_SubjectAct):
    """Authorise the release; the rollback target is loaded first and fixed with it."""

    becomes, verb, asks = commands.AuthoriseRelease, "authorise", ReleaseService.authorise


class ReleaseCandidateAct(_SubjectAct):
    """Release it to one robot, one mission at a time, until its canary is over."""

    becomes, verb = commands.BeginCanary, "release"
    robot_id: base.Slug

    def ask(self, releases: ReleaseService, candidate: Digest, actor: Actor) -> Answered:
        """Raises UnknownName."""
        return releases.release(candidate, self._by(actor), self._seen(), robot_id=RobotId(self.robot_id))


class AdjudicateMissionAct(CandidateAct):
    """Say what became of one canary mission. Whoever released the candidate cannot."""

    becomes, verb = commands.AdjudicateCanaryMission, "adjudicate"
    mission_id: base.Slug
    finding: Finding

    def ask(self, releases: ReleaseService, candidate: Digest, actor: Actor) -> Answered:
        """Raises UnknownName."""
        return releases.adjudicate(candidate, MissionId(self.mission_id), self.finding, self._by(actor))


class RollBackAct(_StatedAct):
    """Go back to the version before it, at once; its configuration is quarantined."""

    becomes, verb, asks = commands.RollBack, "rollback", ReleaseService.rollback


class WithdrawCandidateAct(_StatedAct):
    """Take it back without a fault."""

    becomes, verb, asks = commands.WithdrawCandidate, "withdraw", ReleaseService.withdraw


class SavePolicyAct(base.Act):
    """Say who must agree before a release. A policy that nobody could meet is refused."""

    becomes = commands.SavePolicy
    sentences: ClassVar[Mapping[str, str]] = {
        "kind": N_("There is no such policy; choose one of the two."),
        "quorum": N_("Approvals are counted from 1 to 10; write a whole number."),
        "cooling_off_s": N_("The cooling-off time is no number of hours from 0 to 720."),
    }
    kind: Literal["two_person", "single_operator"]
    quorum: Annotated[int, Field(ge=1, le=10)] = 1
    cooling_off_s: Annotated[float, Field(ge=0, le=LONGEST_WAIT_S, allow_inf_nan=False)] = 0.0
    reason: base.Reason
    key: base.Text = ""

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """A page counts hours."""
        hours = typed.get("cooling_off_h", "").strip()
        try:
            wait_s = str(float(hours or 0.0) * 3600.0)
        except ValueError:
            wait_s = hours
        return super().from_form({**typed, "quorum": typed.get("quorum", "").strip() or "0", "cooling_off_s": wait_s})

    def policy(self) -> ReleasePolicy:
        """What is saved."""
        return ReleasePolicy(kind=self.kind, quorum=self.quorum, cooling_off_s=self.cooling_off_s)


ACTS: Mapping[str, type[CandidateAct]] = {
    one.verb: one
    for one in (
        SubmitCandidateAct,
        CommentCandidateAct,
        RecallReviewAct,
        RequestChangesAct,
        ApproveCandidateAct,
        RejectCandidateAct,
        AuthoriseReleaseAct,
        ReleaseCandidateAct,
        AdjudicateMissionAct,
        RollBackAct,
        WithdrawCandidateAct,
    )
}
"""By the verb in the address."""
