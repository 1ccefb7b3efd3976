"""Shapes what every page carries around its content: navigation, counts, and a stop for every robot."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from app.auth.permissions import permissions_of
from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, reasoned, word
from harness.contracts.actors import Actor
from harness.contracts.ids import RobotId
from harness.contracts.retreat_events import RetreatEnded
from harness.projections.alerts import Alert, status
from harness.projections.control import Retreating, SiteControl
from harness.projections.leases import Lease
from harness.projections.mission import Mission

MOST_IDLE = 6
"""Robots up to which the bar has a button for one that does nothing, too."""


@dataclass(frozen=True)
class StopControl:
    """One robot's stop. `state` is idle, running, stopping, driven or returning; `key` stops it on the keyboard."""

    robot_id: str
    mission_id: str
    state: str
    key: str


@dataclass(frozen=True)
class SafetyNotice:
    """What every page says of a robot's safety: where it is not where it was sent, and what nobody may use."""

    robot_id: str
    text: str
    tone: str
    quarantined: bool = False


@dataclass(frozen=True)
class Shell:
    """`topics` are the signal names this page listens to; `position` is the log's end when it was made.

    `others` are those who have a page open too. `may` is what the operator's roles allow: a template hides what would
    be refused, and decides nothing.
    """

    title: str
    section: str
    operator: str
    roles: str
    may: tuple[str, ...]
    running: int
    waiting: int
    alerts: int
    reviewing: int
    robots: tuple[StopControl, ...]
    notices: tuple[SafetyNotice, ...]
    topics: str
    position: int
    now_s: float
    others: str


NOBODY = Shell("", "", "", "", (), 0, 0, 0, 0, (), (), "", 0, 0.0, "")
"""Around a page that becomes a file: nobody looks at it here."""


@dataclass(frozen=True)
class PageShell:
    """What the header and the navigation read: only the shell."""

    shell: Shell


@dataclass(frozen=True)
class Surroundings:
    """What every page shows of the site: unfinished missions, and the number of questions that wait."""

    missions: Sequence[Mission]
    waiting: int
    robots: Sequence[str]
    actor: Actor
    position: int
    now_s: float
    control: SiteControl = field(default_factory=SiteControl)
    quarantined: Sequence[Lease] = ()
    present: Sequence[str] = ()
    alerts: Sequence[Alert] = ()
    reviewing: int = 0


def shell(title: str, section: str, around: Surroundings, *, topics: Sequence[str] = ()) -> Shell:
    return Shell(
        title=title,
        section=section,
        operator=around.actor.name,
        roles=listed(around.actor.role.split("+")),
        may=permissions_of(around.actor.role.split("+")),
        running=sum(not mission.ended for mission in around.missions),
        waiting=around.waiting,
        alerts=sum(_waits(one, around.now_s) for one in around.alerts),
        reviewing=around.reviewing,
        robots=stop_controls(around.missions, around.robots, around.control),
        notices=safety_notices(around.control, around.quarantined, acknowledged=_acknowledged(around)),
        topics=" ".join((*topics, "mission/", "handoff/", "alert/", "candidate/", "release/", "control/", "lease/")),
        position=around.position,
        now_s=around.now_s,
        others=", ".join(one for one in around.present if one != around.actor.name),
    )


def _waits(alert: Alert, now_s: float) -> bool:
    """Whether nobody has acknowledged it, and it is neither shelved nor suppressed."""
    return status(alert, now_s) in ("unacknowledged", "returned")


def _acknowledged(around: Surroundings) -> frozenset[str]:
    """Robots whose alert about a move to safety somebody has acknowledged."""
    return frozenset(
        alert.newest.robot_id
        for alert in around.alerts
        if alert.newest and alert.newest.kind == "safety_not_reached" and not _waits(alert, around.now_s)
    )


def stop_controls(missions: Sequence[Mission], robots: Sequence[str], control: SiteControl) -> tuple[StopControl, ...]:
    """One per robot that is configured or runs something; of a large fleet, only of those with something to stop.
    `missions` are newest first."""
    names = dict.fromkeys((*robots, *(mission.robot_id for mission in missions if not mission.ended)))
    found = [_stop_control(RobotId(one), missions, control, key=str(at)) for at, one in enumerate(names, start=1)]
    return tuple(one for one in found if one.state != "idle" or len(found) <= MOST_IDLE)


def _stop_control(robot_id: RobotId, missions: Sequence[Mission], control: SiteControl, *, key: str) -> StopControl:
    """Of several open missions the one that moves the robot, else the oldest: it is the next to run."""
    waiting = [one for one in missions if one.robot_id == robot_id and not one.ended and not one.replay]
    mission = next((one for one in waiting if one.invocation is not None), waiting[-1] if waiting else None)
    retreat = control.retreating(robot_id)
    if retreat is not None:
        state = "stopping" if retreat.stop is not None else "returning"
    elif robot_id in control.wheels:
        state = "driven"
    elif mission is None:
        state = "idle"
    else:
        state = "stopping" if mission.status == "stopping" else "running"
    return StopControl(robot_id=robot_id, mission_id=mission.mission_id if mission else "", state=state, key=key)


def safety_notices(
    control: SiteControl, quarantined: Sequence[Lease], *, acknowledged: Collection[str] = ()
) -> tuple[SafetyNotice, ...]:
    """What a person anywhere in the console has to know: a robot on its way to safety, one that did not get there, and
    a robot that nothing may move until somebody looked at it.

    `acknowledged`: robots whose alert about a move to safety somebody has acknowledged.
    """
    notices = [
        notice
        for robot_id, retreat in control.retreats.items()
        if (notice := _of_retreat(retreat)) is not None and (retreat.open or robot_id not in acknowledged)
    ]
    for lease in quarantined:
        robot_id, _, resource = lease.resource.partition("/")
        text = lazy_gettext(
            "{robot_id}: {resource} is quarantined, nothing moves it. {reason}",
            robot_id=robot_id,
            resource=word(resource),
            reason=reasoned(lease.reason),
        )
        notices.append(SafetyNotice(robot_id=robot_id, text=text, tone="bad", quarantined=True))
    return tuple(notices)


def _of_retreat(retreat: Retreating) -> SafetyNotice | None:
    intent, ended = retreat.intent, retreat.ended
    if ended is None:
        text = lazy_gettext("{robot_id} is on its way to {place}.", robot_id=intent.robot_id, place=intent.place)
        return SafetyNotice(robot_id=intent.robot_id, text=text, tone="warn")
    if ended.outcome == "reached":
        return None
    text = lazy_gettext(
        "{robot_id} did not reach {place}: {reason}. {now}",
        robot_id=intent.robot_id,
        place=intent.place,
        reason=reasoned(ended.reason).rstrip("."),
        now=_now(ended),
    )
    return SafetyNotice(robot_id=intent.robot_id, text=text, tone="bad")


def _now(ended: RetreatEnded) -> str:
    """What the robot does now, as far as it is shown."""
    if ended.outcome == "unknown":
        return N_("Nothing shows what it does now: look at it, and use the hardware stop on the robot if it moves.")
    if ended.then == "lie_down":
        return (
            N_("It lies where it is, measured at rest.")
            if ended.then_done
            else N_("It was told to lie down and is not shown to: look at it.")
        )
    return N_("It stands where it is, measured at rest.") if ended.then_done else N_("It is not shown at rest.")
