"""The structs that the API answers with about candidates and releases; its OpenAPI description is derived from them."""

from typing import Any

from app.views.review_results import CaseRow, Family
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.values import Count, Value
from rsi_reviews import contracts
from rsi_reviews.difference import FieldChange
from rsi_reviews.evaluation_jobs import EvaluationCost, EvaluationJob
from rsi_reviews.events import ConfigurationQuarantined, HeldOutLooked, PointerMoved
from rsi_reviews.pointers import Draining, Uptake
from rsi_reviews.projections import CanaryEntry, ReviewEntry


class CandidateEvaluation(Value):
    """How far the evaluation of a candidate is. `ahead`: jobs before a queued one; `left_s`: at the pace so far."""

    candidate: Digest
    job: EvaluationJob | None
    cost: EvaluationCost | None
    ahead: Count
    left_s: float | None


class CandidateSummary(Value):
    """A proposed change to the harness itself."""

    candidate: str
    status: str
    component: str
    metric: str
    author: str
    cycle: Count
    configuration: str
    baseline: str


class ClauseResource(contracts.ClauseAnswer, kw_only=True):
    """A clause of the acceptance predicate; its reason also as a code with facts, an empty code for text alone."""

    sentence_code: str
    sentence_facts: dict[str, Any]


class CandidateResource(CandidateSummary):
    """A candidate with what a decision needs; a decision names `digest` and `cycle`."""

    digest: str
    manifest: contracts.Manifest | None
    authors: tuple[str, ...]
    clauses: tuple[ClauseResource, ...]
    approvals: tuple[str, ...]
    said: tuple[ReviewEntry, ...]
    canary: tuple[CanaryEntry, ...]
    canary_outcome: str
    reason: str
    reason_code: str
    reason_facts: dict[str, Any]


class ConfigurationDifference(Value):
    """A difference by component, and as text."""

    changes: tuple[FieldChange, ...]
    raw: str


class CandidateCheck(Value):
    """The result of checking a candidate that was not stored. `holds`: it breaks no rule."""

    candidate: str
    holds: bool
    refusals: tuple[contracts.RestrictionViolation, ...]
    difference: ConfigurationDifference


class Results(Value):
    """What an evaluation measured. `better_by` is positive where the candidate is better."""

    pairs: Count
    safety_pairs: Count
    pass_to_fail: tuple[CaseRow, ...]
    pass_to_fail_total: Count
    fail_to_pass: tuple[CaseRow, ...]
    fail_to_pass_total: Count
    families: tuple[Family, ...]
    held_out: contracts.HeldOutAnswer | None
    seconds: float


class ReplayedDecision(Value):
    """One decision that would differ: where it stands in the log, and what it was and would be."""

    position: Count
    kind: str
    node_id: str
    before: str
    after: str


class ReplayedMission(Value):
    """One mission, with the decisions that would differ."""

    mission_id: str
    differences: tuple[ReplayedDecision, ...]


class Replay(Value):
    """Stored decisions derived again under a candidate."""

    missions: Count
    decisions: Count
    differing: tuple[ReplayedMission, ...]


class Releases(Value):
    """The pointer to what new missions run under."""

    revision: Count
    configuration: str
    canary: str | None
    canary_robot: RobotId | None
    current_at: str | None
    history: tuple[PointerMoved, ...]
    versions: dict[Digest, Draining]
    pins: dict[Digest, tuple[MissionId, ...]]
    quarantined: tuple[ConfigurationQuarantined, ...]
    looks: tuple[HeldOutLooked, ...]
    uptakes: tuple[Uptake, ...]
    policy: contracts.ReleasePolicy
