"""Defines the commands of the release service. They are data: a command is a request, not a decision."""

from typing import Literal

from harness.contracts.actors import Actor, Command
from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.values import Count, Name
from rsi_reviews import contracts


class ReviewCommand(Command):
    """A command with its author, its reason, and the key under which repeating it changes nothing."""

    actor: Actor
    reason: contracts.Why
    key: Name


class OnSubject(ReviewCommand):
    """A decision on exactly what was shown: the subject's digest and the review cycle."""

    cycle: Count
    subject: Digest


# candidate ----------------------------------------------------------------------------------------------------------


class ProposeCandidate(ReviewCommand, tag=True):
    """Propose a candidate. `baseline` is the configuration itself, so that the decider can compare and refuse what
    loosens.

    `earlier`: authors of the candidates that this one edits or repeats; they stay its authors (D33).
    """

    candidate: contracts.Candidate
    baseline: Configuration
    supersedes: Digest | None = None
    earlier: tuple[Name, ...] = ()


class BeginEvaluation(ReviewCommand, tag=True):
    terms: contracts.EvaluationTerms


class RecordEvaluation(ReviewCommand, tag=True):
    """Record results and the acceptance predicate's report; `terms` are those the results were made under."""

    terms: contracts.EvaluationTerms
    results: contracts.ResultSet
    report: contracts.AcceptanceReport


class OpenReview(ReviewCommand, tag=True):
    pass


class RequestChanges(OnSubject, tag=True):
    pass


class RecallReview(ReviewCommand, tag=True):
    pass


class AddComment(ReviewCommand, tag=True):
    """The reason is the comment."""


class ApproveCandidate(OnSubject, tag=True):
    policy: contracts.ReleasePolicy


class RejectCandidate(OnSubject, tag=True):
    pass


class AuthoriseRelease(OnSubject, tag=True):
    """`proven`: the digest of the rollback target as it was loaded and encoded again just now."""

    policy: contracts.ReleasePolicy
    rollback: Digest
    proven: Digest


class ExpireAuthorisation(Command, tag=True):
    pass


class BeginCanary(OnSubject, tag=True):
    """Release to one robot: new missions of this robot, one at a time, are pinned to the candidate.

    `policy` is the approval policy in force now; an authorisation made under another one still has to satisfy it.

    `recent`: the metric in the baseline's own latest missions on that robot; the canary is compared with them.
    """

    robot_id: RobotId
    policy: contracts.ReleasePolicy
    recent: tuple[float, ...] = ()


class RecordCanaryMission(Command, tag=True):
    measured: contracts.CanaryMission


class AdjudicateCanaryMission(ReviewCommand, tag=True):
    mission_id: MissionId
    finding: contracts.Finding
    policy: contracts.ReleasePolicy


class PromoteCandidate(Command, tag=True):
    """Make the candidate current on every robot, once the canary is over and did not find against it."""


class RollBack(ReviewCommand, tag=True):
    pass


class WithdrawCandidate(ReviewCommand, tag=True):
    pass


CandidateCommand = (
    ProposeCandidate
    | BeginEvaluation
    | RecordEvaluation
    | OpenReview
    | RequestChanges
    | RecallReview
    | AddComment
    | ApproveCandidate
    | RejectCandidate
    | AuthoriseRelease
    | ExpireAuthorisation
    | BeginCanary
    | RecordCanaryMission
    | AdjudicateCanaryMission
    | PromoteCandidate
    | RollBack
    | WithdrawCandidate
)


# pointer ------------------------------------------------------------------------------------------------------------


class OpenPointer(Command, tag=True):
    """Write the first position of the pointer: the version that the program ships."""

    configuration: Digest
    actor: Actor


class Confirm(Command, tag=True):
    """Changes nothing. Refuses unless the state that the other command of this transaction relies on still holds."""

    baseline: Digest | None = None
    policy: contracts.ReleasePolicy | None = None
    configuration: Digest | None = None


class MovePointer(Command, tag=True):
    """`canary` begins on `robot_id`; `released`, `rolled_back` and `withdrawn` end it, for this candidate alone.

    `configuration` is the candidate's, `rollback` where it goes back to. `rolled_back` quarantines the former.
    """

    cause: Literal["canary", "released", "rolled_back", "withdrawn"]
    candidate: Digest
    configuration: Digest
    rollback: Digest
    actor: Actor
    reason: contracts.Why
    robot_id: RobotId | None = None


class SavePolicy(ReviewCommand, tag=True):
    """`reviewers` and `releasers`: the people who hold these roles now. A policy nobody can meet is refused."""

    policy: contracts.ReleasePolicy
    reviewers: tuple[Name, ...]
    releasers: tuple[Name, ...]


class CountLook(Command, tag=True):
    """Count a held-out look of an evaluation, with the alpha it spent."""

    candidate: Digest
    terms: Digest
    answer: contracts.HeldOutAnswer


class RecordUptake(Command, tag=True):
    worker: Name
    revision: Count


class RetireVersion(ReviewCommand, tag=True):
    """Retire a version. `pinned`: unfinished missions that run under it."""

    configuration: Digest
    pinned: tuple[MissionId, ...]


PointerCommand = OpenPointer | Confirm | MovePointer | SavePolicy | CountLook | RecordUptake | RetireVersion
