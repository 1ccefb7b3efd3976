"""Finds what is wrong, and under which cause, from events and live observations. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from harness.contracts import events
from harness.contracts.alert_commands import ClearAlert, RaiseAlert
from harness.contracts.alert_events import AlertKind, Occurrence, Priority
from harness.contracts.control import ControlEvent, PostureShown
from harness.contracts.handoff_events import HandoffEscalated, HandoffEvent, NoAnswerTaken
from harness.contracts.protocol import PhysicalStart, RobotStatus
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.retreat_events import RetreatEnded
from harness.contracts.revision_events import CompletionDisputed
from harness.contracts.routine_approvals import is_routine
from harness.projections.starts import repeated_starts

LOW_CHARGE = 0.20
LOST_AFTER_S = 10.0
LONGEST_TITLE = 160
LONGEST_TEXT = 500
UNCLAIMED = {"next_person": because("unclaimed_for_minute"), "outside": because("unclaimed_for_three_minutes")}
OF_THE_LINK = frozenset({"provider_unavailable", "outcome_unknown", "cancel_unacknowledged"})
"""Failures caused by a robot that does not answer: its own alert reports them."""

AlertChange = tuple[str, RaiseAlert | ClearAlert]
"""A cause, and the command for its alert."""


@dataclass(frozen=True)
class About:
    """Whose event it is, and its position in the log.

    `node` is the latest stage with trouble; `failure` its class; `lost` whether the robot does not answer now; `vetoes`
    the layers whose vetoes the mission had.
    """

    mission_id: str
    robot_id: str
    goal: str
    position: int
    at_s: float
    node: str = ""
    failure: str = ""
    lost: bool = False
    vetoes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RobotReport:
    """What is known of a robot now: its own report, how old that is, and why it does not answer if so."""

    robot_id: str
    status: RobotStatus | None
    age_s: float | None
    trouble: str
    low_before: bool = False


def link_cause(robot_id: str) -> str:
    return f"robot/{robot_id}/link"


def mission_cause(about: About) -> str:
    """Trouble at one stage of one mission is one cause; consequences of a silent robot belong to the silence's
    cause."""
    if about.lost and about.failure in OF_THE_LINK:
        return link_cause(about.robot_id)
    return f"mission/{about.mission_id}/{about.node or 'goal'}"


def of_mission(event: events.MissionEvent, about: About) -> tuple[AlertChange, ...]:
    """What a mission's event raises or clears."""
    match event:
        case events.VetoRaised():
            raised = _raise(
                about, "veto", "critical", because("alert_veto", layer=event.layer), event.reason, event.layer
            )
            return (raised,)
        case events.VetoCleared():
            return _clear(about, f"veto {event.layer}", event.reason)
        case events.VerdictRecorded() if event.verdict.verdict == "unsafe":
            return (
                _raise(
                    about, "unsafe", "critical", because("alert_unsafe", stage=_stage(about.node)), event.verdict.reason
                ),
            )
        case events.HandoffRequested():
            routine = is_routine(event.failure, event.reason)
            title = because("alert_approval" if routine else "alert_handoff", stage=_stage(event.node_id))
            priority: Priority = "medium" if routine else "high"
            return (_raise(about, "handoff", priority, title, event.reason, event.handoff_id),)
        case events.HandoffAnswered():
            reason = because(
                "alert_answered", actor=event.actor.name, channel=event.actor.channel, decision=event.decision
            )
            question = f"handoff {event.handoff_id}"
            return tuple(
                change
                for one in (question, *(f"{question} {level}" for level in UNCLAIMED))
                for change in _clear(about, one, reason)
            )
        case events.StopAcknowledged() if not event.static:
            return (_raise(about, "body_not_static", "critical", because("alert_not_at_rest"), event.reason),)
        case CompletionDisputed():
            title = because("alert_disputed", stage=_stage(event.node_id))
            disputed = replace(about, node=f"{event.node_id}/disputed", failure="")
            return (
                _raise(
                    disputed, "disputed", "high", title, because("said_by", actor=event.actor.name, reason=event.reason)
                ),
            )
        case events.MissionEnded():
            return _ended(event, about)
        case _:
            return ()


def of_handoff(event: HandoffEvent, about: About, handoff_id: str) -> tuple[AlertChange, ...]:
    """An unclaimed question becomes more urgent; from the second step on it is notified again.

    Where the robot could not be shown to do its no-answer action, a person has to look.
    """
    if isinstance(event, NoAnswerTaken) and not event.done:
        title = because("alert_no_answer_not_done", action=event.action)
        return (_raise(about, "body_not_static", "critical", title, event.reason),)
    if not isinstance(event, HandoffEscalated) or event.level not in UNCLAIMED:
        return ()
    title = because("alert_unclaimed", stage=_stage(about.node))
    return (_raise(about, "handoff", "critical", title, UNCLAIMED[event.level], f"{handoff_id} {event.level}"),)


def of_control(event: ControlEvent, *, position: int, at_s: float) -> tuple[AlertChange, ...]:
    """A move to safety, or an order to lie down, that is not shown to have come true is critical until one that is."""
    match event:
        case RetreatEnded() if event.outcome != "reached":
            rests = event.outcome == "short" and event.then_done
            what = because("alert_safety_lies" if rests else "alert_safety_unknown", robot_id=event.robot_id)
            return (_unsafe(event, what, position=position, at_s=at_s),)
        case PostureShown() if not event.done:
            what = because("alert_posture_not_shown", robot_id=event.robot_id, posture=event.posture)
            return (_unsafe(event, what, position=position, at_s=at_s),)
        case RetreatEnded() | PostureShown():
            reason = event.reason
            clear = ClearAlert(condition="safety", reason=reason, at_s=at_s, source=position)
            return ((safety_cause(event.robot_id), clear),)
        case _:
            return ()


def _unsafe(event: RetreatEnded | PostureShown, title: Reason, *, position: int, at_s: float) -> AlertChange:
    occurrence = Occurrence(
        cause=safety_cause(event.robot_id),
        kind="safety_not_reached",
        priority="critical",
        title=title,
        text=event.reason,
        condition="safety",
        source=position,
        robot_id=event.robot_id,
        link=f"/robots/{event.robot_id}",
    )
    return occurrence.cause, RaiseAlert(occurrence=occurrence, at_s=at_s)


def safety_cause(robot_id: str) -> str:
    """The cause under which a robot's moves to safety are one alert."""
    return f"robot/{robot_id}/safety"


def troubled(event: events.MissionEvent, about: About) -> tuple[str, str]:
    """(stage, failure class) of the newest trouble, after this event."""
    match event:
        case events.FailureClassified():
            return event.node_id, event.failure
        case events.HandoffRequested():
            return event.node_id, event.failure
        case _:
            return about.node, about.failure


def of_robot(report: RobotReport) -> tuple[Occurrence, ...]:
    """What is wrong with a robot now; each condition lasts until it is no longer in this list."""
    robot_id, status = report.robot_id, report.status
    silent = report.trouble or (report.age_s is not None and report.age_s > LOST_AFTER_S)
    if silent and (report.age_s is None or report.age_s > LOST_AFTER_S):
        age = because("never_answered") if report.age_s is None else because("last_answered", age_s=report.age_s)
        reason = because("silent_with_trouble", age=age, trouble=report.trouble) if report.trouble else age
        return (_robot(robot_id, "robot_lost", "critical", because("alert_robot_lost"), reason),)
    found = []
    if status is not None and status.charge < LOW_CHARGE + (0.05 if report.low_before else 0.0):
        found.append(
            _robot(
                robot_id,
                "battery_low",
                "high",
                because("alert_battery_low"),
                because("charge_left", charge=status.charge),
            )
        )
    if status is not None and status.hardware_stop:
        found.append(
            _robot(robot_id, "hardware_stop", "critical", because("alert_hardware_stop"), because("by_robots_word"))
        )
    return tuple(found)


def causes_of_robot(robot_id: str) -> Mapping[str, str]:
    """Kind -> cause of everything that `of_robot` may report about a robot."""
    return {
        "robot_lost": link_cause(robot_id),
        "battery_low": f"robot/{robot_id}/battery",
        "hardware_stop": f"robot/{robot_id}/hardware-stop",
    }


def duplicate_starts(about: About, starts: Sequence[PhysicalStart]) -> tuple[Occurrence, ...]:
    """One occurrence if a robot's journal shows a physical start of a request that had started before."""
    repeated = repeated_starts(starts)
    if not repeated:
        return ()
    return (
        Occurrence(
            cause=f"mission/{about.mission_id}/starts",
            kind="duplicate_start",
            priority="critical",
            title=because("alert_duplicate_start", robot_id=about.robot_id),
            text=because("starts_beyond_first", starts=repeated),
            condition=f"starts {len(starts)}",
            robot_id=about.robot_id,
            mission_id=about.mission_id,
            link=f"/missions/{about.mission_id}/report",
        ),
    )


def of_site(
    kind: AlertKind, priority: Priority, title: Explanation, *, cause: str, text: Explanation, link: str = ""
) -> Occurrence:
    """Something wrong with the installation itself; it lasts until it is cleared."""
    return Occurrence(
        cause=cause[:200], kind=kind, priority=priority, condition=kind, link=link,
        title=_cut(title, LONGEST_TITLE), text=_cut(text, LONGEST_TEXT),
    )  # fmt: skip


def _robot(robot_id: str, kind: AlertKind, priority: Priority, title: Reason, text: Reason) -> Occurrence:
    return Occurrence(
        cause=causes_of_robot(robot_id)[kind],
        kind=kind,
        priority=priority,
        title=because("alert_of_robot", robot_id=robot_id, title=title),
        text=text,
        condition=kind,
        robot_id=robot_id,
        link=f"/robots/{robot_id}",
    )


def _raise(
    about: About, kind: AlertKind, priority: Priority, title: Reason, text: Explanation, lasting: str = ""
) -> AlertChange:
    cause = mission_cause(about)
    link = f"/handoffs/{lasting.split(' ')[0]}" if kind == "handoff" else f"/missions/{about.mission_id}"
    why = _cut(text, LONGEST_TEXT) or because("no_reason_given")
    occurrence = Occurrence(
        cause=cause[:200],
        kind=kind,
        priority=priority,
        title=because("alert_at_robot", robot_id=about.robot_id, title=title),
        text=because("alert_with_goal", text=why, goal=about.goal),
        condition=f"{kind} {lasting}" if lasting else "",
        source=about.position,
        robot_id=about.robot_id,
        mission_id=about.mission_id,
        link=link,
    )
    return cause, RaiseAlert(occurrence=occurrence, at_s=about.at_s)


def _ended(event: events.MissionEnded, about: About) -> tuple[AlertChange, ...]:
    """A bad end is trouble of its own, an end verified in part is worth a look; after any end, this mission's vetoes
    no longer hold."""
    title = because("alert_mission_ended", status=event.status)
    bad = event.status in ("failed", "safe_stopped", "handed_off")
    raised = (_raise(about, "mission_failed", "high", title, event.reason),) if bad else ()
    if event.status == "partly_verified":
        raised = (_raise(replace(about, node="", failure=""), "partly_verified", "low", title, event.reason),)
    over = (change for layer in about.vetoes for change in _clear(about, f"veto {layer}", because("the_mission_ended")))
    return (*raised, *over)


def _clear(about: About, condition: str, reason: Explanation) -> tuple[AlertChange, ...]:
    """Under the stage's cause and under the robot's: which of them raised it depends on what was known then."""
    cleared = ClearAlert(condition=condition, reason=_cut(reason, LONGEST_TEXT), at_s=about.at_s, source=about.position)
    return tuple((cause, cleared) for cause in dict.fromkeys((mission_cause(about), link_cause(about.robot_id))))


def _stage(node: str) -> str:
    return node or "the_goal"


def _cut(text: Explanation, longest: int) -> Explanation:
    return text[:longest] if isinstance(text, str) else text
