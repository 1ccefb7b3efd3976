"""Shapes robots: what each reports and shows, its mission, and who is in control."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned
from app.views.robot_map import RobotMapView
from app.views.safe_returns import LastRetreat
from app.views.shell import Shell
from harness.contracts.control import LEVELS, Autonomy
from harness.contracts.ids import RobotId
from harness.contracts.protocol import Picture, RobotStatus
from harness.contracts.reasons import Reason
from harness.projections.admissions import Admission
from harness.projections.control import Retreating, SiteControl, TeleoperationSession
from harness.projections.mission import Mission

OLD_WORD_S = 3.0
OLD_PICTURE_S = 8.0
OLD_POSE_S = 1.0
AUTONOMY: dict[Autonomy, str] = {
    "manual": N_("manual: a person approves every dispatch"),
    "approve_each_motion": N_("approve each motion"),
    "approve_risky": N_("approve risky motion"),
    "autonomous": N_("autonomous within the contract"),
}


@dataclass(frozen=True)
class RobotReportSeen:
    """A robot's newest report. `heard_s` is None if it never answered; `trouble` says why the last question failed."""

    robot_id: RobotId
    status: RobotStatus | None = None
    heard_s: float | None = None
    took_s: float = 0.0
    trouble: str = ""


@dataclass(frozen=True)
class LiveFrame:
    """One live picture: its number in this console, when it came, and its bytes."""

    number: int
    taken_s: float
    picture: Picture


@dataclass(frozen=True)
class Shots:
    """The last seconds of a robot's camera, oldest first. `trouble` says why the newest question brought none."""

    kept: tuple[LiveFrame, ...]
    trouble: str = ""


@dataclass(frozen=True)
class LastReport:
    """A robot's last report and its age in wall time. `link` is good, old or lost."""

    robot_id: str
    heard: bool
    posture: str
    armed: bool
    hardware_stop: bool
    charge: float
    localisation: str
    pose_age_s: float | None
    link: str
    heard_s: float
    link_age_s: float
    took_s: float
    driven: bool
    trouble: str


@dataclass(frozen=True)
class Thumb:
    """One picture of the strip."""

    number: int
    taken_s: float
    age_s: float


@dataclass(frozen=True)
class CameraView:
    """The newest picture, the last seconds before it, and why there is none."""

    robot_id: str
    newest: Thumb | None
    width_px: int
    height_px: int
    strip: tuple[Thumb, ...]
    stale: bool
    why: str


@dataclass(frozen=True)
class StopStep:
    """One step of a stop: whether it is done, and what shows it."""

    title: str
    done: bool
    text: str


@dataclass(frozen=True)
class RobotCard:
    """One robot: word, camera, mission, how many wait behind it, who drives it, its way to safety, who looks at it.

    `retreat` is there while it matters; `retreated` says that there was one, so that the audit log has it.
    """

    robot_id: str
    word: LastReport
    camera: CameraView
    mission: Mission | None
    queued: int
    control: str
    driver: str
    retreating: bool
    retreat: LastRetreat | None
    retreated: bool
    watchers: tuple[str, ...]


@dataclass(frozen=True)
class Level:
    """One choice of autonomy."""

    value: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class RobotsRegion:
    """All robots."""

    robots: tuple[RobotCard, ...]


@dataclass(frozen=True)
class RobotsPage(RobotsRegion):
    """All robots inside the shell of a page, with the fleet's autonomy limit."""

    shell: Shell
    levels: tuple[Level, ...]
    limited_by: str
    limit_reason: str
    present: tuple[str, ...]
    errors: tuple[str, ...]
    absent: tuple[tuple[RobotId, Reason], ...] = ()
    observed: tuple[RobotId, ...] = ()


@dataclass(frozen=True)
class RobotRegion:
    """One robot."""

    robot: RobotCard


@dataclass(frozen=True)
class RobotPage(RobotRegion):
    """One robot inside the shell of a page, with what it can be asked to do.

    `stopped`: this person has just stopped it, and may say why with one of the `reasons`. `typed`: the reason of a form
    that was refused.
    """

    shell: Shell
    robot_map: RobotMapView
    levels: tuple[Level, ...]
    errors: tuple[str, ...]
    stopped: bool
    typed: str
    reasons: tuple[str, ...]
    admissions: tuple[Admission, ...] = ()
    unused: tuple[Reason, ...] = ()


@dataclass(frozen=True)
class CameraRegion:
    """One robot's camera alone."""

    camera: CameraView


@dataclass(frozen=True)
class StopAllPage:
    """The second step of a stop of everything: it names every mission and robot."""

    shell: Shell
    missions: tuple[Mission, ...]
    driven: tuple[str, ...]
    retreating: tuple[str, ...]
    idle: tuple[str, ...]
    reasons: tuple[str, ...]
    errors: tuple[str, ...]


def robot_word(word: RobotReportSeen, *, now_s: float) -> LastReport:
    status = word.status
    age_s = max(now_s - word.heard_s, 0.0) if word.heard_s is not None else 0.0
    link = "lost" if word.heard_s is None or word.trouble else "old" if age_s > OLD_WORD_S else "good"
    return LastReport(
        robot_id=word.robot_id,
        heard=status is not None,
        posture=status.posture if status else "unknown",
        armed=status.armed if status else False,
        hardware_stop=status.hardware_stop if status else False,
        charge=status.charge if status else 0.0,
        localisation=_localisation(word),
        pose_age_s=status.pose_age_s if status else None,
        link=link,
        heard_s=word.heard_s or 0.0,
        link_age_s=age_s,
        took_s=word.took_s,
        driven=bool(status and status.driven_by),
        trouble=word.trouble,
    )


def _localisation(word: RobotReportSeen) -> str:
    status = word.status
    if status is None:
        return "unknown"
    if not status.localised:
        return "lost"
    if status.pose_age_s is None:
        return N_("no pose")
    return "old" if status.pose_age_s > OLD_POSE_S else N_("localised")


def camera_view(robot_id: str, shots: Shots, *, now_s: float) -> CameraView:
    """The strip is oldest first and ends with the newest."""
    strip = tuple(Thumb(one.number, one.taken_s, max(now_s - one.taken_s, 0.0)) for one in shots.kept)
    newest = strip[-1] if strip else None
    stale = newest is None or newest.age_s > OLD_PICTURE_S
    last = shots.kept[-1].picture if shots.kept else None
    return CameraView(
        robot_id=robot_id,
        newest=newest,
        width_px=last.width_px if last else 0,
        height_px=last.height_px if last else 0,
        strip=strip,
        stale=stale,
        why=shots.trouble or ("" if newest else N_("nothing came from the camera yet")),
    )


def stop_steps(mission: Mission) -> tuple[StopStep, ...]:
    """Asked, acknowledged, static: what is known of a stop, step by step; nothing if none was asked for."""
    if mission.stop is None:
        return ()
    running, stopped = mission.invocation, mission.stopped
    acknowledged = running is None
    static = stopped is not None and stopped.static
    if stopped is None:
        evidence = N_("the body is watched by its odometry")
    else:
        evidence = reasoned(stopped.reason) or (
            N_("the body is static") if static else N_("nothing shows the body at rest")
        )
    return (
        StopStep(
            "stopping", True, lazy_gettext("{who}: {reason}", who=mission.stop.actor.name, reason=mission.stop.reason)
        ),
        StopStep(
            "acknowledged",
            acknowledged,
            N_("no execution runs") if acknowledged else N_("the provider has not answered yet"),
        ),
        StopStep("static", static, evidence),
    )


def robot_card(
    word: LastReport,
    camera: CameraView,
    missions: Sequence[Mission],
    *,
    control: SiteControl,
    retreat: LastRetreat | None,
    watchers: Sequence[str],
) -> RobotCard:
    """`missions` are this robot's open ones, newest first: the one that moves it, else the oldest, is its mission."""
    robot_id = RobotId(word.robot_id)
    teleoperation = control.wheels.get(robot_id)
    mine = [one for one in missions if one.robot_id == word.robot_id and not one.replay]
    mission = next((one for one in mine if one.invocation is not None), mine[-1] if mine else None)
    return RobotCard(
        robot_id=word.robot_id,
        word=word,
        camera=camera,
        mission=mission,
        queued=max(len(mine) - 1, 0),
        control=_in_control(mission, teleoperation, control.retreating(robot_id)),
        driver=teleoperation.actor.name if teleoperation else "",
        retreating=control.retreating(robot_id) is not None,
        retreat=retreat,
        retreated=robot_id in control.retreats,
        watchers=tuple(watchers),
    )


def _in_control(mission: Mission | None, teleoperation: TeleoperationSession | None, retreat: Retreating | None) -> str:
    """Who moves the robot now, in words."""
    if retreat is not None:
        return lazy_gettext("the way to {place}", place=retreat.intent.place)
    if teleoperation is not None:
        return lazy_gettext("{who}, by hand from {device}", who=teleoperation.actor.name, device=teleoperation.device)
    if mission is None:
        return "nobody"
    match mission.status:
        case "awaiting_human":
            return N_("nobody: the mission waits for a person")
        case "paused":
            return N_("nobody: the mission is paused")
        case "stopping":
            return N_("the stop")
        case _:
            return N_("the mission")


def levels(chosen: str) -> tuple[Level, ...]:
    return tuple(Level(one, AUTONOMY[one], one == chosen) for one in LEVELS)


def robots_page(
    shell: Shell,
    robots: Sequence[RobotCard],
    control: SiteControl,
    *,
    present: Sequence[str],
    errors: Sequence[str] = (),
    absent: Mapping[RobotId, Reason] = MappingProxyType({}),
    observed: Iterable[RobotId] = (),
) -> RobotsPage:
    """`absent`: robots of the site that could not be connected when this console was started, and why. `observed`:
    those in shadow mode."""
    return RobotsPage(
        shell=shell,
        robots=tuple(robots),
        levels=levels(control.autonomy),
        limited_by=control.limited_by.name if control.limited_by else "",
        limit_reason=control.limit_reason,
        present=tuple(present),
        errors=tuple(errors),
        absent=tuple(absent.items()),
        observed=tuple(sorted(observed)),
    )


def stoppable(missions: Sequence[Mission]) -> tuple[Mission, ...]:
    """Every open mission that acts in the world, by robot."""
    rows = [one for one in missions if not one.replay]
    return tuple(sorted(rows, key=lambda one: (one.robot_id, one.mission_id)))
