"""Shapes what every page carries around its content: navigation, counts, and a stop for every robot."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.auth.permissions import permissions_of
from app.i18n.messages import listed
from harness.contracts.actors import Actor
from harness.projections.mission import Mission


@dataclass(frozen=True)
class StopControl:
    """One robot's stop. `mission_id` is empty when it runs none; `state` is idle, running or stopping."""

    robot_id: str
    mission_id: str
    state: str


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
    topics: str
    position: int
    now_s: float
    others: str


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
    present: Sequence[str] = ()
    alerts: int = 0
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
        alerts=around.alerts,
        reviewing=around.reviewing,
        robots=stop_controls(around.missions, around.robots),
        topics=" ".join((*topics, "mission/", "handoff/", "alert/", "candidate/", "release/")),
        position=around.position,
        now_s=around.now_s,
        others=", ".join(one for one in around.present if one != around.actor.name),
    )


def stop_controls(missions: Sequence[Mission], robots: Sequence[str]) -> tuple[StopControl, ...]:
    """One per robot that is configured or runs something. `missions` are newest first."""
    names = dict.fromkeys((*robots, *(mission.robot_id for mission in missions if not mission.ended)))
    return tuple(_stop_control(robot, missions) for robot in names)


def _stop_control(robot_id: str, missions: Sequence[Mission]) -> StopControl:
    """Of several open missions the one that moves the robot, else the oldest: it is the next to run."""
    waiting = [one for one in missions if one.robot_id == robot_id and not one.ended and not one.replay]
    mission = next((one for one in waiting if one.invocation is not None), waiting[-1] if waiting else None)
    if mission is None:
        return StopControl(robot_id=robot_id, mission_id="", state="idle")
    state = "stopping" if mission.status == "stopping" else "running"
    return StopControl(robot_id=robot_id, mission_id=mission.mission_id, state=state)
