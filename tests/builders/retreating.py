"""Builds a mission that waits in a zone whose fallback is to return to a safe point, and records what its robot
started.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot
from pathlib import Path

from msgspec.structs import replace

from harness.baseline.load import site as shipped_site
from harness.contracts.control import CONTROL
from harness.contracts.ids import MissionId
from harness.contracts.places import Otherwise, Site
from harness.contracts.protocol import PhysicalStart
from harness.contracts.retreat_events import RETREAT
from harness.projections.control import Retreating, SiteControl
from tests.builders.missions_run import ROBOT
from tests.builders.waiting import Waiting, waiting

ASKS = "interrupted:persistent"
"""Every motion is cut off half-way: the mission ends up asking, well localised, 2 m from its dock and on the way."""
LATE_S = 901.0


def retreating_site(otherwise: Otherwise = "lie_down") -> Site:
    """The shipped site where no question is answered: the fallback is to go to the dock, or else this."""
    zones = tuple(
        replace(zone, no_answer="retreat", retreat=replace(zone.retreat, otherwise=otherwise))
        for zone in shipped_site().zones
        if zone.retreat is not None
    )
    return replace(shipped_site(), zones=zones)


@contextmanager
def unanswered(
    *, site: Site | None = None, healed: bool = True, log: Path | None = None, failpoint: str = ""
) -> Iterator[Waiting]:
    """A question that nobody has answered yet. `healed`: no fault interrupts the motions that follow.

    With a `failpoint` the robot keeps its journals beside the log.
    """
    journals = log.with_suffix(".robot") if log and failpoint else None
    place = site or retreating_site()
    with waiting(site=place, log=log, failpoint=failpoint, journals=journals) as made:
        asked = made.asked(fault=ASKS)
        if healed:
            heal(asked)
        yield asked


def heal(asked: Waiting) -> None:
    """From now on the robot has no fault."""
    asked.robot.configure(MissionId("healed"), 3, ())


def sent(asked: Waiting) -> list[PhysicalStart]:
    """The returns to a safe point in the robot's own start journal."""
    return [start for start in asked.robot.starts() if start.node_id == RETREAT]


def newest(asked: Waiting) -> Retreating:
    control: SiteControl = asked.runtime.fold(CONTROL)
    return control.retreats[ROBOT]


def from_dock_m(asked: Waiting) -> float:
    """Distance from the dock by the simulation's ground truth, not by any sensor."""
    body = asked.robot.world.body.state
    return hypot(body.x_m, body.y_m)


def step(asked: Waiting, times: int = 1) -> None:
    """The robot's loop takes this many steps, half a second of the robot's time apart."""
    for _ in range(times):
        asked.pass_s(0.5)
