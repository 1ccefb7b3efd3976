"""Answers questions about candidates: results, clauses, pointer and pinned missions, as the log has them.
Writes nothing.
"""

import msgspec

from harness.contracts.configuration import Configuration
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.ports import StoredEvent
from harness.contracts.reasons import because
from harness.contracts.values import digest
from harness.runtime import Runtime
from rsi_reviews import contracts, pointers
from rsi_reviews.canary import Outcome, outcome
from rsi_reviews.canary_metrics import canary_missions, ran
from rsi_reviews.difference import CandidateDifference, difference
from rsi_reviews.projections import Review
from rsi_reviews.refused_proposals import REFUSED, ProposalRefused, Refusals
from rsi_reviews.release import release_clause
from rsi_reviews.static_check import objections
from rsi_reviews.suite_growth import GROWTH, Growth

ANY_ROBOT = RobotId("any")


class CandidateQueries:
    """Read-only questions about candidates, versions and the pointer. Raises UnknownName for a candidate that
    does not exist.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime

    # candidates -----------------------------------------------------------------------------------------------------

    def reviews(self) -> list[Review]:
        """All candidates, newest first."""
        return [self._runtime.fold(stream) for stream in reversed(self._runtime.streams("candidate/"))]

    def review(self, candidate: str) -> Review:
        """The candidate by its digest, or by a prefix of the digest that is unique."""
        found = [
            stream for stream in self._runtime.streams("candidate/") if stream.startswith(f"candidate/{candidate}")
        ]
        if not candidate or len(found) != 1:
            if candidate and found:
                raise UnknownName(because("candidate_prefix_ambiguous", prefix=candidate, count=len(found)))
            raise UnknownName(because("unknown_candidate", candidate=candidate))
        review: Review = self._runtime.fold(found[0])
        return review

    def candidate(self, candidate: str) -> contracts.Candidate:
        """The candidate itself, its configuration read from the log."""
        review = self.review(candidate)
        if review.manifest is None:
            raise UnknownName(because("unknown_candidate", candidate=candidate))
        configuration = self._runtime.stored_configuration(review.configuration)
        return contracts.Candidate(configuration=configuration, manifest=review.manifest, baseline=review.baseline)

    def results(self, candidate: str) -> contracts.ResultSet | None:
        """What was measured, as it was recorded; None before that."""
        review = self.review(candidate)
        if review.evaluation is None:
            return None
        return msgspec.json.decode(self._runtime.record(review.evaluation.result_set).body, type=contracts.ResultSet)

    def report(self, candidate: str) -> contracts.AcceptanceReport | None:
        """Clauses 1 to 3 as they were answered; None before that."""
        evaluation = self.review(candidate).evaluation
        return evaluation.report if evaluation else None

    def clauses(self, candidate: str) -> tuple[contracts.ClauseAnswer, ...]:
        """All four clauses as they stand now (R160)."""
        review = self.review(candidate)
        first = review.evaluation.report.clauses if review.evaluation else ()
        return (*first, release_clause(review))

    def diff(self, candidate: str) -> CandidateDifference:
        """The candidate's changes against its baseline, by component and raw."""
        review = self.review(candidate)
        return difference(
            self._runtime.stored_configuration(review.baseline),
            self._runtime.stored_configuration(review.configuration),
        )

    def refusals(self, candidate: contracts.Candidate) -> tuple[contracts.RestrictionViolation, ...]:
        """Every reason for which this proposal would be refused now, without proposing it. Raises
        ConfigurationMissing.
        """
        baseline = self._runtime.stored_configuration(self.current(ANY_ROBOT))
        return objections(candidate, baseline)

    def refused_proposals(self) -> tuple[ProposalRefused, ...]:
        """Proposals that a rule refused, newest first."""
        refusals: Refusals = self._runtime.fold(REFUSED)
        return refusals.kept[::-1]

    def refused_proposal(self, candidate: str) -> ProposalRefused:
        """Raises UnknownName."""
        refusals: Refusals = self._runtime.fold(REFUSED)
        found = refusals.of(candidate)
        if found is None:
            raise UnknownName(because("unknown_candidate", candidate=candidate[:64]))
        return found

    def events(self, candidate: str) -> list[StoredEvent]:
        """The candidate's whole history, as stored (R161, R167)."""
        return self._runtime.stream(pointers.candidate_stream(self.review(candidate).candidate))

    def canary_outcome(self, candidate: str) -> Outcome:
        """The present result of the candidate's canary."""
        return outcome(self.review(candidate))

    # pointer --------------------------------------------------------------------------------------------------------

    def growth(self) -> Growth:
        """The cases that people added to the shipped regression suite on this site."""
        growth: Growth = self._runtime.fold(GROWTH)
        return growth

    def pointer(self) -> pointers.Pointer:
        """The pointer's position, history, policy, held-out looks and quarantine."""
        pointer: pointers.Pointer = self._runtime.fold(pointers.POINTER)
        return pointer

    def current(self, robot_id: RobotId = ANY_ROBOT) -> Digest:
        """The version that a mission of this robot would be pinned to if it began now."""
        return self._runtime.current_configuration_id(robot_id)

    def current_at(self, instant_s: float, *, robot_id: RobotId | None = None) -> Digest | None:
        """The version that was current at this wall time; None before the pointer was first written."""
        return pointers.current_at(self.pointer(), instant_s, robot_id=robot_id)

    def pins(self) -> dict[Digest, tuple[MissionId, ...]]:
        """Unfinished missions by the version they are pinned to."""
        return pointers.pins(self._runtime.open_missions())

    def versions(self) -> dict[Digest, pointers.Draining]:
        """Every known version, and whether anything runs under it."""
        pinned = self.pins()
        current = self.current()
        known = {current, *(review.configuration for review in self.reviews()), *pinned}
        return pointers.versions(self.pointer(), sorted(known), pinned, current=current)

    def loads(self, configuration: Digest) -> Digest:
        """Load a version and encode it again: the result is its own id if a rollback to it is possible. Raises
        ConfigurationMissing.
        """
        loaded: Configuration = self._runtime.stored_configuration(configuration)
        return digest(loaded)


def on_trial(runtime: Runtime, configuration_id: Digest) -> bool:
    """Whether a version is in canary (D28, D34). For `open_harness(trial=...)`."""
    pointer: pointers.Pointer = runtime.fold(pointers.POINTER)
    return bool(pointer.version) and pointer.canary == configuration_id


def selected(runtime: Runtime, robot_id: RobotId) -> Digest | None:
    """The version that the pointer gives a robot's next mission; None while no candidate was ever proposed here.

    For `open_harness(select=...)`. A canary runs one mission at a time. The next one begins only when the one before is
    over and adjudicated, and none begins once the canary's own rule has reached a result.
    """
    pointer: pointers.Pointer = runtime.fold(pointers.POINTER)
    if not pointer.version:
        return None
    if pointer.canary is None or pointer.trial is None or robot_id != pointer.robot_id:
        return pointer.configuration
    review: Review = runtime.fold(pointers.candidate_stream(pointer.trial))
    free = outcome(review) == "go_on" and not _occupied(runtime, review)
    return pointer.canary if free else pointer.configuration


def _occupied(runtime: Runtime, review: Review) -> bool:
    """Whether a canary mission that has begun is not over and adjudicated yet."""
    under_way = (
        one.configuration == review.configuration and not one.replay and one.status not in ("draft", "compiled")
        for one in runtime.open_missions()
    )
    unjudged = (entry.finding is None for entry in review.canary)
    missed = (ran(one) and review.entry(one.mission_id) is None for one in canary_missions(runtime, review))
    return any(under_way) or any(unjudged) or any(missed)
