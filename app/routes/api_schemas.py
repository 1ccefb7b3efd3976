"""The structs that the API answers with; its OpenAPI description is derived from them."""

from typing import Any, Literal

import msgspec

from app.i18n.reasons.rendering import sentence
from app.views.fleet import OperatingMode
from app.views.review_results import CaseRow, Family
from harness.contracts.control import Autonomy
from harness.contracts.exploration import TargetAnswer, TargetQuestion
from harness.contracts.ids import Digest, HandoffId, MissionId, RobotId
from harness.contracts.protocol import RobotStatus
from harness.contracts.readings import ClauseObject, TextSpan
from harness.contracts.reasons import Reason
from harness.contracts.spoken_goals import SpokenGoal, Transcription
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Value
from harness.projections.exploration import ExplorationDecision
from harness.projections.unverified import UnverifiedPart
from rsi_reviews import contracts
from rsi_reviews.difference import FieldChange
from rsi_reviews.evaluation_jobs import EvaluationCost, EvaluationJob
from rsi_reviews.events import ConfigurationQuarantined, HeldOutLooked, PointerMoved
from rsi_reviews.pointers import Draining, Uptake
from rsi_reviews.projections import CanaryEntry, ReviewEntry


class ChangedSince(Value):
    """One field that is no longer as it was shown."""

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
    """The recovery steps of one mission."""

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
    """One stage of a mission; `accepted_at_k` is the state version of its acceptance.

    `declared_at_k`: the one at which it ended with an effect that only its provider declares.
    """

    node_id: str
    status: str
    attempt: Count
    provider_id: str | None
    verdict: str | None
    accepted_at_k: Count | None
    declared_at_k: Count | None


class SegmentResource(Value):
    """One route of a mission in metres: planned, declared and measured."""

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
    """The declared result of an analysis, with the digest of its report."""

    text: str
    report_sha256: str | None
    values: dict[str, Any]


class ReceiptOutcome(Value):
    """What a service declared that it did; it is never measured. `at`: RFC 3339, UTC."""

    receipt_id: str
    kind: str
    node_id: str
    source: str
    at: str
    text: str
    sha256: str | None
    values: dict[str, Any]


class UnreadResource(Value):
    """Words of a goal that were not read: characters from `start` up to `end`, and why."""

    start: Count
    end: Count
    words: str
    why: str


class ReadClauseResource(Value):
    """One clause of a reading. `words` are the parts of the text that it accounts for."""

    number: Count
    act: str
    object: ClauseObject | None
    negated: bool
    count: Count
    spans: tuple[TextSpan, ...]
    words: str
    seconds: Count | msgspec.UnsetType = msgspec.UNSET


class ReadingResource(Value):
    """What a goal was read as. `digest` is what a person confirms."""

    digest: str
    told: str
    reader: str
    site: str
    clauses: tuple[ReadClauseResource, ...]
    defaults: tuple[str, ...]
    unread: tuple[UnreadResource, ...]


class ClauseCondition(Value):
    """One condition that a clause is judged by; verdict, levels and evidence once the goal was tested."""

    condition_id: str
    text: str
    verdict: str | None
    evidence: tuple[str, ...]
    independence: Count | None
    required_independence: Count | None


class ClauseOutcome(Value):
    """One clause, or default of the mission profile, of a mission's goal."""

    clause: str
    told: str
    verdict: str | None
    conditions: tuple[ClauseCondition, ...]


class DeclaredCondition(Value):
    """A condition that only a provider declares, or a completion condition that rests on one (`node_id` null)."""

    condition_id: str
    node_id: str | None
    text: str


class GoalCondition(Value):
    """One completion condition as it was tested last: levels of independence 0 to 2, and what the answer rests on."""

    condition_id: str
    text: str
    verdict: str
    independence: Count
    required_independence: Count
    sources: tuple[str, ...]
    rests_on: tuple[str, ...]


class ProposalOutcome(Value):
    """What a provider proposed to become a fact: accepted, tested and not accepted, or untested.

    `verdict` is that of the condition it is about; null where nothing tested it.
    """

    node_id: str
    packet_id: str
    provider_id: str
    name: str
    arguments: dict[str, Any]
    verdict: str | None
    status: Literal["accepted", "tested", "untested"]


class UploadResource(Value):
    """A file that comes in pieces of at most `piece_bytes`; the next one goes to `received_bytes`."""

    upload_id: str
    name: str
    kind: str
    size_bytes: int
    received_bytes: int
    piece_bytes: int


class ReplayResource(Value):
    """A replay: `state` is waiting, reading, running, ended, refused or cancelled; `status` is its mission's end."""

    replay_id: str
    upload_id: str
    name: str
    state: str
    mission_id: str
    status: str
    problem: str
    problem_code: str


class RecordingHeard(Value):
    """A stored recording of a goal, written down twice: among the sentences that are known here, and freely.

    `wake` is the phrase before the command, `speech_s` from when until when somebody speaks, where that was measured;
    `decoder` is who heard it freely, `problem` why another that was to did not.
    """

    recording: str
    recogniser: str
    text: str
    free: str
    duration_s: float
    agreed: bool
    wake: str
    speech_s: tuple[float, float] | None
    decoder: str
    problem: str


class SpeechOpened(Value):
    """The name of a stream that chunks of speech are sent to."""

    stream: str


class SpeechHeard(Value):
    """The words of a goal so far: they may change with what follows, and start nothing."""

    partial: str


def as_answered(found: Transcription) -> RecordingHeard:
    """What a recording says, as the API answers it."""
    return RecordingHeard(
        recording=found.recording,
        recogniser=found.recogniser,
        text=found.text,
        free=found.free,
        duration_s=found.duration_s,
        agreed=found.agreed,
        wake=found.wake or "",
        speech_s=found.speech_s or None,
        decoder=found.decoder or found.recogniser,
        problem=sentence(found.problem) if found.problem else "",
    )


class MessageOutcome(Value):
    """A message that a channel acknowledged; `sent_s` is wall time where `wall`, else mission time."""

    node_id: str
    request_id: str
    channel: str
    ids: str
    text: str
    images: Count
    sent_s: float
    wall: bool
    read_s: tuple[float, ...]
    shown: Literal["read_back", "declared", "open"]


class SpokenReportOutcome(Value):
    """A report that was spoken: the sound that was made, until when it was played, and what the room recorded."""

    node_id: str
    sound: str
    played_s: float
    recorded: str
    shown: Literal["heard", "declared", "open"]


class PlannerOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """How many stages a planner proposed, and how many of its proposals were refused."""

    planner: str
    stages: Count
    overruled: Count


class ModelOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """One model's answers in the mission, with seconds and cost."""

    model: str
    asked: Count
    refused: Count
    seconds: float
    cost: float
    currency: str


class AdviceOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What a model said in one role. It has no authority; `refused` says why it was not followed."""

    role: str
    node_id: str | None
    model: str
    said: str
    action: str
    refused: str
    refused_code: str
    refused_facts: dict[str, Any]
    seconds: float
    cost: float
    currency: str
    input_tokens: Count | None
    output_tokens: Count | None
    exchange: str


class ProposersOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Who proposed what: deterministic planners, or models by name."""

    planners: tuple[PlannerOutcome, ...]
    models: tuple[ModelOutcome, ...]
    advice: tuple[AdviceOutcome, ...]


class MissionOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a mission: declared by providers, measured by the harness, accepted by the gate."""

    mission_id: str
    robot_id: str
    goal: str
    spoken: SpokenGoal | None
    reading: ReadingResource | None
    clauses: tuple[ClauseOutcome, ...]
    template: str
    status: str
    disputed: tuple[str, ...]
    goal_verdict: str | None
    goal_conditions: tuple[GoalCondition, ...]
    declared_conditions: tuple[DeclaredCondition, ...]
    unverified_parts: tuple[UnverifiedPart, ...]
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
    messages: tuple[MessageOutcome, ...]
    spoken_reports: tuple[SpokenReportOutcome, ...]
    proposals: tuple[ProposalOutcome, ...]
    proposed_by: ProposersOutcome
    recovery: RecoverySpend
    dispatches: Count
    physical_starts: Count | None
    duplicate_starts: Count | None
    events: Count


class MissionPreview(Value):
    """The preview of a mission: its compiled contract, not stored. `longest_s` is the sum of its time limits."""

    robot_id: RobotId
    configuration: str
    highest_risk: str
    longest_s: float
    stages: tuple[str, ...]
    contract: TaskContract
    reading: ReadingResource | None


class ProposedGoal(Value):
    """A goal that waits for a person, and how it is read now; nothing of it has started."""

    proposal_id: str
    robot_id: RobotId
    goal: str
    reading: ReadingResource | None


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
    """One line of the access log, which has its own hash chain."""

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
    """One robot: the process that drives it, its last report with its age, its mission, and who is in control."""

    robot_id: str
    worker: str
    mode: OperatingMode
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


class FleetResource(Value):
    """One robot of the site, whichever process drives it: where it says it is, and how it is reached.

    `here`: the process that answers drives it. `link` is good, old or lost.
    """

    robot_id: str
    worker: str
    here: bool
    mode: OperatingMode
    charge: float | None
    link: str
    link_age_s: float | None
    trouble: str
    mission_id: MissionId | None
    mission_status: str | None
    handoff_id: HandoffId | None
    queued: Count
    x_m: float | None
    y_m: float | None
    pose_old: bool


class SiteControlResource(Value):
    """The limit of autonomy that holds for every mission."""

    autonomy: Autonomy
    limited_by: str | None
    reason: str


class CandidateEvaluation(Value):
    """How far the evaluation of a candidate is. `ahead`: jobs before a queued one; `left_s`: at the pace so far."""

    candidate: Digest
    job: EvaluationJob | None
    cost: EvaluationCost | None
    ahead: Count
    left_s: float | None


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


class ExplorationChoice(Value):
    """One target of an exploring mission. `question` and `answer` are null where their records are not kept."""

    decision: ExplorationDecision
    question: TargetQuestion | None
    answer: TargetAnswer | None


class SignInLink(Value):
    """A link that signs one person in once."""

    url: str
