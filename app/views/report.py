"""Shapes a mission's report for people who were not there, with each statement labelled by its source."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, word
from app.views.evidence import Unsound
from app.views.handoffs import NO_ANSWER_ACTIONS
from app.views.marked_pictures import MarkedPicture
from app.views.measures import ConditionRow
from app.views.missions import MissionHeader, goal_conditions, goal_reason, head
from app.views.proposers import Proposers, proposers
from app.views.shell import Shell
from app.views.stages import Observed, Stage, stages
from app.views.timeline import TimelineEntry
from harness.contracts import events
from harness.contracts.ids import NodeId
from harness.contracts.protocol import Receipt
from harness.contracts.revision_events import AttestationRecorded, CompletionDisputed
from harness.projections.handoffs import NoAnswerAction
from harness.projections.mission import Mission
from harness.projections.unverified import UnverifiedPart, unverified_parts
from rsi_reviews.suite_growth import NOT_DONE


@dataclass(frozen=True)
class Timing:
    """One stage in mission time: dispatched first, accepted last, and how many attempts lay between."""

    node_id: str
    dispatched_s: float | None
    accepted_s: float | None
    attempts: int
    took_s: float | None


@dataclass(frozen=True)
class ReportPicture:
    """One picture of the report, by the digest of its bytes. `marked`: what an analysis found in it."""

    blob: str
    node_id: str
    at_s: float
    broken: Unsound | None
    marked: MarkedPicture | None = None


@dataclass(frozen=True)
class DeclaredResult:
    """What a service said when it had done something: declared, never measured."""

    kind: str
    node_id: str
    text: str
    source: str
    receipt_id: str
    at_s: float
    blob: str


@dataclass(frozen=True)
class ReportAction:
    """What a person did, or what recovery spent."""

    at_s: float
    who: str
    text: str


@dataclass(frozen=True)
class ReportPage:
    """One mission's report as it stands at `position` of the log, whose event has `digest`."""

    shell: Shell
    mission_id: str
    head: MissionHeader
    verdict: str
    reason: str
    conditions: tuple[ConditionRow, ...]
    unverified: tuple[UnverifiedPart, ...]
    stages: tuple[Stage, ...]
    timings: tuple[Timing, ...]
    findings: tuple[DeclaredResult, ...]
    receipts: tuple[DeclaredResult, ...]
    pictures: tuple[ReportPicture, ...]
    actions: tuple[ReportAction, ...]
    disputes: tuple[ReportAction, ...]
    unaccepted: tuple[str, ...]
    proposers: Proposers
    errors: tuple[str, ...]
    starts: int | None
    duplicates: int | None
    is_case: bool
    can_be_case: bool
    position: int
    digest: str


@dataclass(frozen=True)
class ReportSources:
    """What is known of a mission outside its own events.

    Physical starts and repeated ones by the robot's journal, None where it cannot be read; whether the regression
    suite holds it as a case; what its robot did because nobody answered.
    """

    starts: int | None
    duplicates: int | None
    is_case: bool = False
    unanswered: NoAnswerAction | None = None


def report_page(
    shell: Shell,
    mission: Mission,
    entries: Sequence[TimelineEntry],
    journal: ReportSources,
    broken: dict[str, Unsound | None],
    *,
    marked: Mapping[str, MarkedPicture] = MappingProxyType({}),
    errors: Sequence[str] = (),
) -> ReportPage:
    """`broken`: for every picture whose bytes do not match their digest now, why; `marked`: what was found in it."""
    words = _words(entries)
    goal = mission.goal_verdict
    return ReportPage(
        shell=shell,
        mission_id=mission.mission_id,
        head=head(mission, entries),
        verdict=mission.goal_outcome,
        reason=goal_reason(mission) if goal else N_("The goal has not been tested."),
        conditions=goal_conditions(mission),
        unverified=unverified_parts(mission),
        stages=stages(mission, entries, Observed(), selected=""),
        timings=timings(mission, entries),
        findings=tuple(word for word in words if word.kind == "analysis"),
        receipts=tuple(word for word in words if word.kind != "analysis"),
        pictures=tuple(
            ReportPicture(blob=blob, node_id=node_id, at_s=at_s, broken=broken.get(blob), marked=marked.get(blob))
            for blob, node_id, at_s in pictures(entries)
        ),
        actions=_actions(entries, journal.unanswered),
        disputes=tuple(
            ReportAction(entry.mission_s, entry.event.actor.name, f"{entry.event.condition_id}: {entry.event.reason}")
            for entry in entries
            if isinstance(entry.event, CompletionDisputed)
        ),
        unaccepted=tuple(
            name for name, node in mission.nodes.items() if node.status not in ("committed", "declared", "superseded")
        ),
        proposers=proposers(entries),
        errors=tuple(errors),
        starts=journal.starts,
        duplicates=journal.duplicates,
        is_case=journal.is_case,
        can_be_case=bool(mission.disputed or mission.status in NOT_DONE) and not mission.replay,
        position=entries[-1].position,
        digest=entries[-1].digest,
    )


def pictures(entries: Sequence[TimelineEntry]) -> tuple[tuple[str, str, float], ...]:
    """(blob, stage, sensor time) of every camera frame, by time."""
    taken: dict[str, tuple[str, str, float]] = {}
    for entry in entries:
        if isinstance(entry.event, events.PacketRetained):
            packet = entry.event.packet
            for one in (*packet.before, *packet.after):
                if one.kind == "image":
                    taken.setdefault(one.blob, (one.blob, packet.identity.node_id, one.from_s))
    return tuple(sorted(taken.values(), key=lambda one: one[2]))


def timings(mission: Mission, entries: Sequence[TimelineEntry]) -> tuple[Timing, ...]:
    """One per stage that was dispatched, in that order; an abort-return is none of the stages."""
    sent: dict[NodeId, float] = {}
    accepted: dict[NodeId, float] = {}
    for entry in entries:
        match entry.event:
            case events.DispatchIntended(node_id=node_id):
                sent.setdefault(node_id, entry.mission_s)
            case events.NodeCommitted(node_id=node_id, aborting=False):
                accepted[node_id] = entry.mission_s
            case _:
                continue
    return tuple(
        Timing(
            node_id=node_id,
            dispatched_s=at_s,
            accepted_s=accepted.get(node_id),
            attempts=mission.nodes[node_id].attempt if node_id in mission.nodes else 0,
            took_s=accepted[node_id] - at_s if node_id in accepted else None,
        )
        for node_id, at_s in sent.items()
    )


def _words(entries: Sequence[TimelineEntry]) -> tuple[DeclaredResult, ...]:
    return tuple(
        _word(receipt, entry.event.packet.identity.node_id)
        for entry in entries
        if isinstance(entry.event, events.PacketRetained)
        for receipt in entry.event.packet.receipts
    )


def _word(receipt: Receipt, node_id: str) -> DeclaredResult:
    return DeclaredResult(
        kind=receipt.kind,
        node_id=node_id,
        text=receipt.text,
        source=receipt.source,
        receipt_id=receipt.receipt_id,
        at_s=receipt.at_s,
        blob=receipt.blob or "",
    )


def _actions(entries: Sequence[TimelineEntry], unanswered: NoAnswerAction | None) -> tuple[ReportAction, ...]:
    found: list[ReportAction] = []
    for entry in entries:
        match entry.event:
            case events.HandoffAnswered(actor=actor, decision=decision, reason=reason):
                found.append(
                    ReportAction(
                        entry.mission_s,
                        f"{actor.name} ({actor.channel})",
                        lazy_gettext("{decision}: {reason}", decision=word(decision), reason=reason),
                    )
                )
                if decision == "expired" and unanswered is not None:
                    found.append(ReportAction(entry.mission_s, "robot", no_answer_taken(unanswered)))
            case events.StopRequested(actor=actor, reason=reason):
                found.append(
                    ReportAction(entry.mission_s, actor.name, lazy_gettext("asked to stop: {reason}", reason=reason))
                )
            case CompletionDisputed(actor=actor, reason=reason):
                found.append(
                    ReportAction(
                        entry.mission_s, actor.name, lazy_gettext("disputed an acceptance: {reason}", reason=reason)
                    )
                )
            case AttestationRecorded(actor=actor, condition_id=condition_id):
                found.append(
                    ReportAction(
                        entry.mission_s, actor.name, lazy_gettext("attested {condition_id}", condition_id=condition_id)
                    )
                )
            case events.RecoveryAuthorised(action=action, failure=failure, cost=cost):
                text = lazy_gettext(
                    "{action} after {failure}, cost {cost}", action=word(action), failure=word(failure), cost=cost
                )
                found.append(ReportAction(entry.mission_s, N_("recovery policy"), text))
            case _:
                continue
    return tuple(found)


def no_answer_taken(unanswered: NoAnswerAction) -> str:
    """What the robot did because nobody answered: shown to be done or not, and never an accepted result."""
    action, reason = NO_ANSWER_ACTIONS[unanswered.action], unanswered.reason
    if unanswered.done:
        return lazy_gettext("without an answer: {action}, shown to be done. {reason}", action=action, reason=reason)
    return lazy_gettext("without an answer: {action}, not shown to be done. {reason}", action=action, reason=reason)
