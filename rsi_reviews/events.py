"""Defines the events of a candidate and of the pointer. Each candidate has one stream; the pointer has one."""

from typing import Literal

from harness.contracts.actors import Actor, Event
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Share, Value
from rsi_reviews import contracts


class Signed(Value):
    """Who decided, why, and the key under which the same request again returns the same receipt.

    `body` is the digest of the whole request. `override`: it counted only because of the single-operator policy.
    """

    actor: Actor
    reason: contracts.Why
    key: Name
    body: Digest
    at_s: float
    override: bool = False


# candidate ----------------------------------------------------------------------------------------------------------


class CandidateProposed(Event, tag=True):
    """The manifest and its digest are recorded before anything runs (R156, D31)."""

    candidate: Digest
    configuration: Digest
    manifest: contracts.Manifest
    manifest_digest: Digest
    baseline: Digest
    sections: tuple[contracts.Section, ...]
    by: Signed
    supersedes: Digest | None = None
    earlier: tuple[Name, ...] = ()


class EvaluationBegun(Event, tag=True):
    """Predicate, suite, seeds and evaluator are fixed here; results under other terms are refused."""

    terms: contracts.EvaluationTerms
    terms_digest: Digest
    by: Signed


class EvaluationRecorded(Event, tag=True):
    """The evaluation's answer (R161). `bound`: the metric's quantile over the `bound_missions` of the baseline."""

    terms: Digest
    result_set: Digest
    report: contracts.AcceptanceReport
    report_digest: Digest
    answer: contracts.Answer
    bound: float
    bound_missions: Count
    by: Signed


class ReviewOpened(Event, tag=True):
    """People are asked to review exactly this subject, in this cycle."""

    cycle: Count
    subject: contracts.Subject
    subject_digest: Digest
    by: Signed


class ChangesRequested(Event, tag=True):
    """Back to its authors: every approval of the cycle is void."""

    cycle: Count
    by: Signed


class ReviewRecalled(Event, tag=True):
    """The candidate's own authors withdrew it from review; approvals are void."""

    cycle: Count
    by: Signed


class CommentAdded(Event, tag=True):
    cycle: Count
    by: Signed


class CandidateApproved(Event, tag=True):
    cycle: Count
    subject: Digest
    by: Signed


class CandidateRejected(Event, tag=True):
    cycle: Count
    subject: Digest
    by: Signed


class ReleaseAuthorised(Event, tag=True):
    """The fourth clause (R160). The rollback target is fixed here and was loaded at `proven_at_s`."""

    cycle: Count
    subject: Digest
    rollback: Digest
    proven_at_s: float
    expires_at_s: float
    by: Signed


class AuthorisationExpired(Event, tag=True):
    cycle: Count
    at_s: float


class CanaryBegun(Event, tag=True):
    """The canary began. Beyond `bound` a mission counts as worse; it is a quantile over `bound_missions` of the
    baseline's own.
    """

    robot_id: RobotId
    bound: float
    bound_missions: Count
    by: Signed


class CanaryMissionRecorded(Event, tag=True):
    measured: contracts.CanaryMission
    at_s: float


class CanaryMissionAdjudicated(Event, tag=True):
    """Somebody who did not release the candidate judged this mission (D34)."""

    mission_id: MissionId
    finding: contracts.Finding
    by: Signed


class CandidateReleased(Event, tag=True):
    """The canary passed: the candidate is current for every robot."""

    reason: contracts.Why
    at_s: float


class CandidateRolledBack(Event, tag=True):
    """Quarantined: nothing selects this configuration again."""

    reason: contracts.Why
    by: Signed


class CandidateWithdrawn(Event, tag=True):
    """Withdrawn without a fault: not quarantined."""

    reason: contracts.Why
    by: Signed


CandidateEvent = (
    CandidateProposed
    | EvaluationBegun
    | EvaluationRecorded
    | ReviewOpened
    | ChangesRequested
    | ReviewRecalled
    | CommentAdded
    | CandidateApproved
    | CandidateRejected
    | ReleaseAuthorised
    | AuthorisationExpired
    | CanaryBegun
    | CanaryMissionRecorded
    | CanaryMissionAdjudicated
    | CandidateReleased
    | CandidateRolledBack
    | CandidateWithdrawn
)


# pointer ------------------------------------------------------------------------------------------------------------

Cause = Literal["shipped", "canary", "released", "rolled_back", "withdrawn"]


class PointerMoved(Event, tag=True):
    """What new missions are pinned to from now on: `canary` on `robot_id` alone, `configuration` everywhere else.

    `released` is the candidate whose configuration is current (none: what the program ships), `rollback` the version to
    go back to, `trial` the candidate in canary.
    """

    revision: Count
    cause: Cause
    configuration: Digest
    rollback: Digest
    released: Digest | None
    canary: Digest | None
    trial: Digest | None
    robot_id: RobotId | None
    actor: Actor
    reason: Explanation
    at_s: float


class ConfigurationQuarantined(Event, tag=True):
    configuration: Digest
    candidate: Digest
    reason: Explanation
    at_s: float


class PolicySaved(Event, tag=True):
    policy: contracts.ReleasePolicy
    by: Signed


class HeldOutLooked(Event, tag=True):
    """One look at the held-out suite was spent (D32): `alpha` of it, whatever it answers."""

    candidate: Digest
    terms: Digest
    look: Count
    alpha: Share
    at_s: float


class UptakeRecorded(Event, tag=True):
    """A worker works under this revision from now on."""

    worker: Name
    revision: Count
    at_s: float


class VersionRetired(Event, tag=True):
    """Nothing will select it again and nothing is pinned to it; the log keeps it."""

    configuration: Digest
    by: Signed


PointerEvent = PointerMoved | ConfigurationQuarantined | PolicySaved | HeldOutLooked | UptakeRecorded | VersionRetired
