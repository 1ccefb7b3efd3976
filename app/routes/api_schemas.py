"""What the API answers, as structs: an answer is built from one, and the description of the API is derived from it."""

from typing import Any

import msgspec

from harness.contracts.control import Autonomy
from harness.contracts.exploration import TargetAnswer, TargetQuestion
from harness.contracts.ids import Digest, HandoffId, MissionId, RobotId
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import Reason
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Value
from harness.projections.exploration import ExplorationDecision
from rsi_reviews import contracts
from rsi_reviews.difference import FieldChange
from rsi_reviews.events import ConfigurationQuarantined, HeldOutLooked, PointerMoved
from rsi_reviews.pointers import Draining, Uptake
from rsi_reviews.projections import CanaryEntry, ReviewEntry


class ChangedSince(Value):
    """What is not as it was shown."""

    name: str
    was: str
    now: str


class ProblemDocument(Value):
    """RFC 9457. `code` is the slug for machines, `do` what can be done now; `changes` since what was answered.

    `reason` is code and facts of what `detail` says; a refusal also has its `rule`.
    """

    type: str
    title: str
    status: Count
    detail: str
    code: str
    do: str
    changes: tuple[ChangedSince, ...] = ()
    rule: str = ""
    reason: Reason | None = None


class RecoverySpend(Value):
    """Steps of recovery of one mission."""

    spent: Count
    remaining: Count


class MissionSummary(Value):
    """One mission in a list. Times are wall seconds since the Unix epoch."""

    mission_id: str
    robot_id: str
    goal: str
    template: str
    status: str
    stage: str
    stage_code: str
    stage_facts: dict[str, Any]
    goal_verdict: str | None
    state_version: Count
    handoff_id: str | None
    began_s: float
    ended_s: float | None
    recovery: RecoverySpend


class StageOutcome(Value):
    """One stage of a mission; `accepted_at_k` is the state version of its acceptance."""

    node_id: str
    status: str
    attempt: Count
    provider_id: str | None
    verdict: str | None
    accepted_at_k: Count | None


class SegmentResource(Value):
    """One way of a mission, metres: as planned, as declared, as measured."""

    name: str
    reference_length_m: float | None
    declared_distance_m: float | None
    measured_distance_m: float | None
    last_pose_distance_m: float | None
    path_length_m: float | None


class ImageResource(Value):
    """One picture that a packet refers to. `captured_at`: RFC 3339, UTC."""

    sha256: str
    width: Count
    height: Count
    captured_at: str


class AnalysisFinding(Value):
    """What an analysis said: the service's word, with the digest of its report."""

    text: str
    report_sha256: str | None
    values: dict[str, Any]


class ReceiptOutcome(Value):
    """A service's word on what it did: declared, never measured. `at`: RFC 3339, UTC."""

    receipt_id: str
    kind: str
    node_id: str
    source: str
    at: str
    text: str
    sha256: str | None
    values: dict[str, Any]


class MissionOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a mission: declared by providers, measured by the harness, accepted by the gate."""

    mission_id: str
    robot_id: str
    goal: str
    template: str
    status: str
    goal_verdict: str | None
    reason: str
    reason_code: str
    reason_facts: dict[str, Any]
    report: str
    report_code: str
    report_facts: dict[str, Any]
    state_version: Count
    configuration: str
    seed: Count
    labels: dict[str, Any]
    handoff_id: str | None
    stages: tuple[StageOutcome, ...]
    segments: tuple[SegmentResource, ...]
    images: tuple[ImageResource, ...]
    findings: tuple[AnalysisFinding, ...]
    receipts: tuple[ReceiptOutcome, ...]
    recovery: RecoverySpend
    dispatches: Count
    physical_starts: Count | None
    duplicate_starts: Count | None
    events: Count


class MissionPreview(Value):
    """What a mission would be: its contract, compiled and not stored. `longest_s` is the sum of its time limits."""

    robot_id: RobotId
    configuration: str
    highest_risk: str
    longest_s: float
    stages: tuple[str, ...]
    contract: TaskContract


class LogEvent(msgspec.Struct, frozen=True, kw_only=True):
    """One event with its place in the hash chain."""

    position: Count
    version: Count
    kind: str
    mission_s: float
    recorded_s: float
    previous: str
    digest: str
    event: dict[str, Any]


class TrailEntry(Value):
    """One line of the access trail, a hash chain of its own."""

    number: Count
    at_s: float
    kind: str
    actor: str
    role: str
    subject: str
    detail: str
    source: str
    previous: str
    digest: str


class Caller(Value):
    """Who a caller is."""

    name: str
    roles: tuple[str, ...]
    scopes: tuple[str, ...]
    robot_id: str | None
    may: tuple[str, ...]


class AccountResource(Value):
    """One person."""

    name: str
    roles: tuple[str, ...]
    disabled: bool
    created_at_s: float
    changed_at_s: float


class TokenResource(Value):
    """One token, without its secret."""

    token_id: str
    name: str
    scopes: tuple[str, ...]
    robot_id: str
    created_by: str
    created_at_s: float
    expires_at_s: float | None
    used_at_s: float | None
    revoked_at_s: float | None


class IssuedToken(TokenResource):
    """A new token: `token` is shown this once."""

    token: str


class RobotResource(Value):
    """One robot: what it declares of itself with the age of its word, its mission, and who is in control."""

    robot_id: str
    status: RobotStatus | None
    link_age_s: float | None
    trouble: str
    mission_id: MissionId | None
    mission_status: str | None
    handoff_id: HandoffId | None
    autonomy: Autonomy | None
    queued: Count
    driver: str | None
    watchers: tuple[str, ...]


class SiteControlResource(Value):
    """The limit of autonomy that holds for every mission."""

    autonomy: Autonomy
    limited_by: str | None
    reason: str


class StopsAsked(Value):
    """Missions that were asked to stop; `refused` says why others were not."""

    asked: tuple[str, ...]
    refused: tuple[str, ...]


class WheelSession(Value):
    """Who drives a robot by hand."""

    robot_id: str
    session: str
    driver: str
    device: str


class AlertSummary(Value):
    """One alert: everything with one cause. Times are wall seconds."""

    alert_id: str
    title: str
    text: str
    kind: str
    state: str
    priority: str
    count: Count
    total: Count
    first_s: float
    last_s: float
    assignee: str
    put_away: str
    shelved_until_s: float | None
    link: str


class AlertLine(Value):
    """One line of an alert's history."""

    at_s: float
    text: str
    position: Count


class AlertResource(AlertSummary):
    """One alert with what lasts and its history, newest first."""

    conditions: tuple[str, ...]
    history: tuple[AlertLine, ...]


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


class CandidateResource(CandidateSummary):
    """A candidate with what a decision needs; a decision names `digest` and `cycle`."""

    digest: str
    manifest: contracts.Manifest | None
    authors: tuple[str, ...]
    clauses: tuple[contracts.ClauseAnswer, ...]
    approvals: tuple[str, ...]
    said: tuple[ReviewEntry, ...]
    canary: tuple[CanaryEntry, ...]
    canary_outcome: str
    reason: str


class ConfigurationDifference(Value):
    """By component, and raw."""

    changes: tuple[FieldChange, ...]
    raw: str


class CandidateCheck(Value):
    """What the static check says of a candidate that was not stored. `holds`: it breaks no rule."""

    candidate: str
    holds: bool
    refusals: tuple[contracts.RestrictionViolation, ...]
    difference: ConfigurationDifference


class CaseResource(Value):
    """One case under both configurations. `before` and `after` are the declared metric, `change` which way it went."""

    case: str
    family: str
    seed: int
    situation: str
    before: float
    after: float
    before_status: str
    after_status: str
    change: str
    note: str


class Family(Value):
    """Pairs of one family, with the 95 % interval of their difference."""

    family: str
    n: Count
    baseline: float
    candidate: float
    better_by: float
    low: float
    high: float


class Results(Value):
    """What an evaluation measured. `better_by` is positive where the candidate is better."""

    pairs: Count
    safety_pairs: Count
    pass_to_fail: tuple[CaseResource, ...]
    pass_to_fail_total: Count
    fail_to_pass: tuple[CaseResource, ...]
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


class ExplorationChoice(Value):
    """One target of an exploring mission. `question` and `answer` are null where their records are not kept."""

    decision: ExplorationDecision
    question: TargetQuestion | None
    answer: TargetAnswer | None


class SignInLink(Value):
    """A link that lets one person in once."""

    url: str
