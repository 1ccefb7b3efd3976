"""The structs that the API answers with about missions and goals; its OpenAPI description is derived from them."""

from typing import Any, Literal

import msgspec

from app.i18n.reasons.rendering import sentence
from harness.contracts.exploration import TargetAnswer, TargetQuestion
from harness.contracts.ids import RobotId
from harness.contracts.readings import ClauseObject, TextSpan
from harness.contracts.spoken_goals import SpokenGoal, Transcription
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Value
from harness.projections.exploration import ExplorationDecision
from harness.projections.unverified import UnverifiedPart


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


class ExplorationChoice(Value):
    """One target of an exploring mission. `question` and `answer` are null where their records are not kept."""

    decision: ExplorationDecision
    question: TargetQuestion | None
    answer: TargetAnswer | None
