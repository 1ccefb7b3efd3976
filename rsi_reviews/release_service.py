"""Offers the release process to people, optimisers and the evaluator; each request is one transaction at the gate."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from harness.contracts.actors import Actor
from harness.contracts.configuration_record import configuration_record
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest, MissionId, RobotId, StreamId
from harness.contracts.ports import Record
from harness.contracts.reasons import because
from harness.contracts.values import Value, digest, encode
from harness.runtime import Runtime
from rsi_reviews import commands, contracts
from rsi_reviews.acceptance import Evaluation, accepted
from rsi_reviews.canary_metrics import recent_values
from rsi_reviews.canary_watch import Starts, catch_up, no_duplicates, settle
from rsi_reviews.candidate_queries import ANY_ROBOT, CandidateQueries
from rsi_reviews.pointers import POINTER, candidate_stream
from rsi_reviews.projections import Review
from rsi_reviews.refused_proposals import REFUSED, KeepRefusal
from rsi_reviews.rollback import DESK
from rsi_reviews.suite_growth import GROWTH, AddCase, case_of

Answered = Accepted[Any] | Refused
Judge = Callable[[Evaluation], contracts.AcceptanceReport]


@dataclass(frozen=True)
class SignedBy:
    """Who asks, why, and the key under which repeating the request changes nothing."""

    actor: Actor
    reason: str
    key: str

    @property
    def fields(self) -> dict[str, Any]:
        return {"actor": self.actor, "reason": self.reason, "key": self.key}


@dataclass(frozen=True)
class SeenSubject:
    """Exactly what the person was shown: the subject's digest and the cycle it was asked in."""

    cycle: int
    subject: Digest


class ReleaseService(CandidateQueries):
    """Every request is accepted or refused as a whole. Queries are in `CandidateQueries`.

    `judge` is the acceptance predicate: a report never comes from outside. Raises UnknownName for an unknown candidate.
    """

    def __init__(self, runtime: Runtime, *, judge: Judge = accepted) -> None:
        super().__init__(runtime)
        self._judge = judge

    # proposing and evaluating ---------------------------------------------------------------------------------------

    def propose(
        self, candidate: contracts.Candidate, signed: SignedBy, *, supersedes: Digest | None = None
    ) -> Answered:
        """Record a candidate. Its authors are those of every candidate it edits or repeats, and the person who
        proposes it. One that breaks a rule is refused, and kept among the refused proposals.
        """
        self._open_pointer()
        if violations := self.refusals(candidate):
            self._keep_refusal(candidate, violations, signed.actor)
        configuration = candidate.configuration.configuration_id
        earlier = {
            hand.name
            for review in self.reviews()
            if review.configuration == configuration or review.candidate == supersedes
            for hand in review.hands
            if review.candidate != candidate.candidate_id
        }
        current = self.current()
        command = commands.ProposeCandidate(
            candidate=candidate,
            baseline=self._runtime.stored_configuration(current),
            supersedes=supersedes,
            earlier=tuple(sorted(earlier)),
            **signed.fields,
        )
        confirm = commands.Confirm(baseline=candidate.baseline, configuration=configuration)
        records = (configuration_record(candidate.configuration), self._runtime.configuration_record(current))
        return self._decide(candidate.candidate_id, command, confirm, *records)

    def _keep_refusal(
        self, candidate: contracts.Candidate, violations: tuple[contracts.RestrictionViolation, ...], actor: Actor
    ) -> None:
        command = KeepRefusal(
            actor=actor,
            candidate=candidate.candidate_id,
            configuration=candidate.configuration.configuration_id,
            manifest=candidate.manifest,
            violations=violations,
        )
        self._runtime.decide([(REFUSED, command)], records=(configuration_record(candidate.configuration),))

    def begin(self, terms: contracts.EvaluationTerms, signed: SignedBy) -> Answered:
        """Fix the terms of the evaluation, before anything runs."""
        command = commands.BeginEvaluation(terms=terms, **signed.fields)
        return self._decide(self.review(terms.candidate).candidate, command, commands.Confirm(baseline=terms.baseline))

    def submit_results(self, evaluation: Evaluation, signed: SignedBy) -> Answered:
        """Record what was measured, judged here by the acceptance predicate itself."""
        report = self._judge(evaluation)
        terms, results = evaluation.terms, evaluation.results
        command = commands.RecordEvaluation(terms=terms, results=results, report=report, **signed.fields)
        look = results.held_out
        counted = commands.CountLook(candidate=terms.candidate, terms=digest(terms), answer=look) if look else None
        records = (_record("result_set", results), _record("acceptance_report", report))
        return self._decide(self.review(terms.candidate).candidate, command, counted, *records)

    def add_case(self, mission_id: MissionId, signed: SignedBy) -> Answered:
        """A disputed or failed mission becomes a case of the regression suite here. Raises UnknownName for one that
        does not exist.
        """
        case = case_of(self._runtime.mission(mission_id))
        if isinstance(case, Refused):
            return case
        command = AddCase(actor=signed.actor, mission_id=mission_id, case=case, reason=signed.reason)
        return self._runtime.decide([(GROWTH, command)])

    # reviewing ------------------------------------------------------------------------------------------------------

    def submit(self, candidate: Digest, signed: SignedBy) -> Answered:
        """Ask people to review the candidate, in a new cycle."""
        review = self.review(candidate)
        confirm = commands.Confirm(baseline=review.baseline, configuration=review.configuration)
        return self._decide(candidate, commands.OpenReview(**signed.fields), confirm)

    def comment(self, candidate: Digest, signed: SignedBy) -> Answered:
        return self._decide(self.review(candidate).candidate, commands.AddComment(**signed.fields))

    def recall(self, candidate: Digest, signed: SignedBy) -> Answered:
        return self._decide(self.review(candidate).candidate, commands.RecallReview(**signed.fields))

    def request_changes(self, candidate: Digest, signed: SignedBy, seen: SeenSubject) -> Answered:
        command = commands.RequestChanges(cycle=seen.cycle, subject=seen.subject, **signed.fields)
        return self._decide(self.review(candidate).candidate, command)

    def reject(self, candidate: Digest, signed: SignedBy, seen: SeenSubject) -> Answered:
        command = commands.RejectCandidate(cycle=seen.cycle, subject=seen.subject, **signed.fields)
        return self._decide(self.review(candidate).candidate, command)

    def approve(self, candidate: Digest, signed: SignedBy, seen: SeenSubject) -> Answered:
        """One person's approval of exactly what they saw. Refused if the baseline is no longer current."""
        review, policy = self.review(candidate), self.pointer().policy
        command = commands.ApproveCandidate(policy=policy, cycle=seen.cycle, subject=seen.subject, **signed.fields)
        return self._decide(candidate, command, _still(review, policy))

    # releasing ------------------------------------------------------------------------------------------------------

    def authorise(self, candidate: Digest, signed: SignedBy, seen: SeenSubject) -> Answered:
        """The fourth clause. The rollback target is loaded here, before anything is decided."""
        review, policy = self.review(candidate), self.pointer().policy
        rollback = review.manifest.rollback if review.manifest else review.baseline
        command = commands.AuthoriseRelease(
            policy=policy,
            rollback=rollback,
            proven=self.loads(rollback),
            cycle=seen.cycle,
            subject=seen.subject,
            **signed.fields,
        )
        return self._decide(candidate, command, _still(review, policy))

    def release(self, candidate: Digest, signed: SignedBy, seen: SeenSubject, *, robot_id: RobotId) -> Answered:
        """Begin the canary on one robot: the pointer moves in the same transaction."""
        self._runtime.decide([(candidate_stream(candidate), commands.ExpireAuthorisation())])
        review, policy = self.review(candidate), self.pointer().policy
        metric = review.manifest.metric if review.manifest else "recovery_cost"
        command = commands.BeginCanary(
            robot_id=robot_id,
            policy=policy,
            recent=recent_values(self._runtime, metric, review.baseline, robot_id),
            cycle=seen.cycle,
            subject=seen.subject,
            **signed.fields,
        )
        move = self._move(review, "canary", signed.actor, signed.reason, robot_id=robot_id)
        return self._decide(candidate, command, move)

    def adjudicate(
        self, candidate: Digest, mission_id: MissionId, finding: contracts.Finding, signed: SignedBy
    ) -> Answered:
        """Record the finding on one canary mission, by somebody who did not release it, and act on it at once."""
        command = commands.AdjudicateCanaryMission(
            mission_id=mission_id, finding=finding, policy=self.pointer().policy, **signed.fields
        )
        decision = self._decide(self.review(candidate).candidate, command)
        if isinstance(decision, Accepted):
            settle(self._runtime)
        return decision

    def catch_up(self, duplicate_starts: Starts = no_duplicates) -> Answered:
        """Add finished canary missions to the canary and act on them; call this when a mission has ended."""
        return catch_up(self._runtime, duplicate_starts=duplicate_starts)

    def rollback(self, candidate: Digest, signed: SignedBy) -> Answered:
        """Go back to the version before it, at once; its unfinished missions are paused for a person's decision."""
        review, trial = self.review(candidate), self.pointer().trial
        requests: list[tuple[StreamId, Any]] = [
            (POINTER, self._move(review, "rolled_back", signed.actor, signed.reason)),
        ]
        if trial is not None and trial != candidate:
            why = because("baseline_rolled_back", why=signed.reason)
            withdrawn = commands.WithdrawCandidate(actor=DESK, reason=why, key=f"baseline:{candidate}")
            requests.append((candidate_stream(trial), withdrawn))
        decision = self._decided(candidate, commands.RollBack(**signed.fields), requests)
        if isinstance(decision, Accepted) and decision.events:
            revoked = because("pinned_rolled_back", why=signed.reason)
            self._runtime.pause_pinned(review.configuration, actor=signed.actor, reason=revoked)
        return decision

    def withdraw(self, candidate: Digest, signed: SignedBy) -> Answered:
        """Withdraw without a fault; the configuration is not quarantined."""
        review = self.review(candidate)
        in_canary = review.status == "canary"
        move = self._move(review, "withdrawn", signed.actor, signed.reason) if in_canary else None
        return self._decide(candidate, commands.WithdrawCandidate(**signed.fields), move)

    # policy and versions --------------------------------------------------------------------------------------------

    def save_policy(
        self,
        policy: contracts.ReleasePolicy,
        signed: SignedBy,
        *,
        reviewers: tuple[str, ...],
        releasers: tuple[str, ...],
    ) -> Answered:
        """Who must agree before a release, with the people who hold these roles now."""
        self._open_pointer()
        command = commands.SavePolicy(policy=policy, reviewers=reviewers, releasers=releasers, **signed.fields)
        return self._runtime.decide([(POINTER, command)])

    def retire(self, configuration: Digest, signed: SignedBy) -> Answered:
        """Never select this version again; refused while missions are pinned to it."""
        pinned = self.pins().get(configuration, ())
        command = commands.RetireVersion(configuration=configuration, pinned=pinned, **signed.fields)
        return self._runtime.decide([(POINTER, command)])

    def take_up(self, worker: str) -> Answered:
        """A worker reports that it works under the pointer's present revision."""
        pointer = self.pointer()
        if not pointer.version:
            return Accepted(())
        return self._runtime.decide([(POINTER, commands.RecordUptake(worker=worker, revision=pointer.revision))])

    # ----------------------------------------------------------------------------------------------------------------

    def _open_pointer(self) -> None:
        if not self.pointer().version:
            shipped = self.current(ANY_ROBOT)
            record = self._runtime.configuration_record(shipped)
            self._runtime.decide(
                [(POINTER, commands.OpenPointer(configuration=shipped, actor=DESK))], records=(record,)
            )

    def _decide(self, candidate: Digest, command: Any, pointing: Any = None, *records: Record) -> Answered:
        """The command on the candidate, and the command by which the pointer confirms or moves."""
        return self._decided(candidate, command, [(POINTER, pointing)] if pointing is not None else [], *records)

    def _decided(
        self, candidate: Digest, command: Any, others: list[tuple[StreamId, Any]], *records: Record
    ) -> Answered:
        """Decide all of them or none. A request that was accepted before returns its receipt, whatever has
        happened since.
        """
        stream = candidate_stream(candidate)
        if command.key not in self._runtime.fold(stream).receipts:
            decision = self._runtime.decide([(stream, command), *others], records=records)
            if isinstance(decision, Accepted) or command.key not in self._runtime.fold(stream).receipts:
                return decision
        return self._runtime.decide([(stream, command)])

    def _move(
        self, review: Review, cause: Any, actor: Actor, reason: str, *, robot_id: RobotId | None = None
    ) -> commands.MovePointer:
        rollback = review.authorised.rollback if review.authorised else review.baseline
        return commands.MovePointer(
            cause=cause,
            candidate=review.candidate,
            configuration=review.configuration,
            rollback=rollback,
            actor=actor,
            reason=reason,
            robot_id=robot_id,
        )


def _still(review: Review, policy: contracts.ReleasePolicy) -> commands.Confirm:
    """What an approval and an authorisation depend on, confirmed in the same transaction."""
    return commands.Confirm(baseline=review.baseline, policy=policy, configuration=review.configuration)


def _record(kind: str, value: Value) -> Record:
    return Record(digest=digest(value), kind=kind, body=encode(value))
