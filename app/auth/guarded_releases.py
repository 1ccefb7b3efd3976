"""Wraps the release service: every act is checked, signed with the person's name, and written to the audit log."""

from typing import Any, Protocol

from app.auth.command_permissions import asked_permission
from app.auth.guarded_runtime import AuditLog, principal
from app.auth.permissions import MEANING, OF_ACCOUNTS, NotPermitted, Permission
from harness.contracts.actors import Actor, Command
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, MissionId
from harness.contracts.reasons import because
from harness.runtime import Runtime
from rsi_reviews import commands
from rsi_reviews.candidate_queries import CandidateQueries
from rsi_reviews.contracts import Candidate, ReleasePolicy
from rsi_reviews.release_service import ReleaseService, SignedBy
from rsi_reviews.suite_growth import GROWTH, AddCase

Answered = Accepted[Any] | Refused


class CandidateRequest(Protocol):
    """What a person asks about a candidate, and which command it is."""

    @property
    def becomes(self) -> type[Command]: ...

    def ask(self, releases: ReleaseService, candidate: Digest, actor: Actor) -> Answered: ...


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
        self._written(commands.ProposeCandidate, signed.actor, f"candidate/{candidate.candidate_id}", decision)
        return decision

    def ask(self, candidate: Digest, act: CandidateRequest) -> Answered:
        """One act on a candidate. Raises UnknownName, and NotPermitted before anything is decided."""
        needed = asked_permission(act.becomes)
        actor = principal().acting(needed)
        self._of_an_account(needed)
        decision = act.ask(self._releases, candidate, actor)
        self._written(act.becomes, actor, f"candidate/{candidate}", decision)
        return decision

    def add_case(self, mission_id: MissionId, say: SignedBy) -> Answered:
        signed = _signed(AddCase, say)
        decision = self._releases.add_case(mission_id, signed)
        self._written(AddCase, signed.actor, GROWTH, decision)
        return decision

    def save_policy(
        self, policy: ReleasePolicy, say: SignedBy, *, reviewers: tuple[str, ...], releasers: tuple[str, ...]
    ) -> Answered:
        signed = _signed(commands.SavePolicy, say)
        decision = self._releases.save_policy(policy, signed, reviewers=reviewers, releasers=releasers)
        self._written(commands.SavePolicy, signed.actor, "release/pointer", decision)
        return decision

    def _of_an_account(self, needed: Permission) -> None:
        """Where two people must agree, whoever came by the first link is none of them: anybody could come by it."""
        if principal().invited and needed in OF_ACCOUNTS and self.pointer().policy.kind == "two_person":
            raise NotPermitted(because("account_needed", meaning=MEANING[needed]), where=principal().name)

    def _written(self, kind: type[Command], actor: Actor, subject: str, decision: Answered) -> None:
        outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
        self._audit_log(principal(), actor, kind.__name__, subject, outcome)


def _signed(kind: type[Command], signed: SignedBy) -> SignedBy:
    """The principal as an actor in the role that allows the act. Raises NotPermitted."""
    return SignedBy(actor=principal().acting(asked_permission(kind)), reason=signed.reason, key=signed.key)
