"""Wraps the release service: every act is checked, signed with the person's name, and written to the audit log."""

from typing import Any

from app.auth.command_permissions import asked_permission
from app.auth.guarded_runtime import AuditLog, principal
from harness.contracts.actors import Command
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.runtime import Runtime
from rsi_reviews import commands
from rsi_reviews.candidate_queries import CandidateQueries
from rsi_reviews.contracts import Candidate, Finding, ReleasePolicy
from rsi_reviews.release_service import ReleaseService, SeenSubject, SignedBy
from rsi_reviews.suite_growth import GROWTH, AddCase

Answered = Accepted[Any] | Refused


class GuardedReleaseService(CandidateQueries):
    """What people may do with candidates and releases, and nothing else of the service; reading is free.

    Whoever asks is the visitor in the one role that allows it, whatever the caller had written there. Every act raises
    NotPermitted before anything is decided. What the service does by its own rule stays its own.
    """

    def __init__(self, runtime: Runtime, audit_log: AuditLog) -> None:
        super().__init__(runtime)
        self._releases = ReleaseService(runtime)
        self._audit_log = audit_log

    def propose(self, candidate: Candidate, say: SignedBy, *, supersedes: Digest | None = None) -> Answered:
        signed = _signed(commands.ProposeCandidate, say)
        decision = self._releases.propose(candidate, signed, supersedes=supersedes)
        return self._told(commands.ProposeCandidate, signed, candidate.candidate_id, decision)

    def submit(self, candidate: Digest, say: SignedBy) -> Answered:
        signed = _signed(commands.OpenReview, say)
        return self._told(commands.OpenReview, signed, candidate, self._releases.submit(candidate, signed))

    def comment(self, candidate: Digest, say: SignedBy) -> Answered:
        signed = _signed(commands.AddComment, say)
        return self._told(commands.AddComment, signed, candidate, self._releases.comment(candidate, signed))

    def recall(self, candidate: Digest, say: SignedBy) -> Answered:
        signed = _signed(commands.RecallReview, say)
        return self._told(commands.RecallReview, signed, candidate, self._releases.recall(candidate, signed))

    def request_changes(self, candidate: Digest, say: SignedBy, seen: SeenSubject) -> Answered:
        signed = _signed(commands.RequestChanges, say)
        decision = self._releases.request_changes(candidate, signed, seen)
        return self._told(commands.RequestChanges, signed, candidate, decision)

    def approve(self, candidate: Digest, say: SignedBy, seen: SeenSubject) -> Answered:
        signed = _signed(commands.ApproveCandidate, say)
        return self._told(commands.ApproveCandidate, signed, candidate, self._releases.approve(candidate, signed, seen))

    def reject(self, candidate: Digest, say: SignedBy, seen: SeenSubject) -> Answered:
        signed = _signed(commands.RejectCandidate, say)
        return self._told(commands.RejectCandidate, signed, candidate, self._releases.reject(candidate, signed, seen))

    def authorise(self, candidate: Digest, say: SignedBy, seen: SeenSubject) -> Answered:
        signed = _signed(commands.AuthoriseRelease, say)
        return self._told(
            commands.AuthoriseRelease, signed, candidate, self._releases.authorise(candidate, signed, seen)
        )

    def release(self, candidate: Digest, say: SignedBy, seen: SeenSubject, *, robot_id: RobotId) -> Answered:
        """Raises NotPermitted before an authorisation that is over is marked so."""
        signed = _signed(commands.BeginCanary, say)
        decision = self._releases.release(candidate, signed, seen, robot_id=robot_id)
        return self._told(commands.BeginCanary, signed, candidate, decision)

    def adjudicate(self, candidate: Digest, mission_id: MissionId, finding: Finding, say: SignedBy) -> Answered:
        signed = _signed(commands.AdjudicateCanaryMission, say)
        decision = self._releases.adjudicate(candidate, mission_id, finding, signed)
        return self._told(commands.AdjudicateCanaryMission, signed, candidate, decision)

    def rollback(self, candidate: Digest, say: SignedBy) -> Answered:
        signed = _signed(commands.RollBack, say)
        return self._told(commands.RollBack, signed, candidate, self._releases.rollback(candidate, signed))

    def withdraw(self, candidate: Digest, say: SignedBy) -> Answered:
        signed = _signed(commands.WithdrawCandidate, say)
        return self._told(commands.WithdrawCandidate, signed, candidate, self._releases.withdraw(candidate, signed))

    def add_case(self, mission_id: MissionId, say: SignedBy) -> Answered:
        signed = _signed(AddCase, say)
        decision = self._releases.add_case(mission_id, signed)
        self._written(AddCase, signed, GROWTH, decision)
        return decision

    def save_policy(
        self, policy: ReleasePolicy, say: SignedBy, *, reviewers: tuple[str, ...], releasers: tuple[str, ...]
    ) -> Answered:
        signed = _signed(commands.SavePolicy, say)
        decision = self._releases.save_policy(policy, signed, reviewers=reviewers, releasers=releasers)
        self._written(commands.SavePolicy, signed, "release/pointer", decision)
        return decision

    def _told(self, kind: type[Command], say: SignedBy, candidate: Digest, decision: Answered) -> Answered:
        self._written(kind, say, f"candidate/{candidate}", decision)
        return decision

    def _written(self, kind: type[Command], say: SignedBy, subject: str, decision: Answered) -> None:
        outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
        self._audit_log(principal(), say.actor, kind.__name__, subject, outcome)


def _signed(kind: type[Command], say: SignedBy) -> SignedBy:
    """The principal as an actor in the role that allows the act. Raises NotPermitted."""
    return SignedBy(actor=principal().acting(asked_permission(kind)), reason=say.reason, key=say.key)
