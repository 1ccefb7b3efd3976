"""Holds the robots of one worker of the fleet campaign, each with a folder that outlives the worker's process."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from experiments.campaigns.plan import Disturbance, DisturbanceName
from experiments.campaigns.shift_robots import ShiftRobots, harness_over, parts_on
from experiments.campaigns.wire import WiredRobot
from harness.adapters.ids import SystemIds
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.spool import FileSpool
from harness.bootstrap import Harness
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ports import Clock, EventStore

Answer = TypeVar("Answer")


class CutLink:
    """The link to one robot: between two instants of its mission time nothing comes through. Implements RobotLink."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._from_s = self._until_s = math.inf
        self.refused = 0

    def cut(self, *, from_s: float, for_s: float) -> None:
        """From that instant on, for so long."""
        self._from_s, self._until_s = from_s, from_s + for_s

    def carry(self, call: Callable[[], Answer], *, older: Answer | None = None, acts: bool = False) -> Answer:
        """The answer of a call. Raises ProviderUnreachable while the link is down."""
        if self._from_s <= self._clock.now().mission_s < self._until_s:
            self.refused += 1
            raise ProviderUnreachable("The link to the robot is down")
        return call()

    def strikes(self, name: DisturbanceName) -> Disturbance | None:
        """Nothing else is wrong with it."""


class FleetRobots(ShiftRobots):
    """The robots of one worker on the files of `folder`, each over a link that can be cut."""

    def __init__(self, names: tuple[str, ...], folder: Path, *, seed: int, store: EventStore) -> None:
        self.links: dict[str, CutLink] = {}
        blobs, spool = FileBlobStore(folder / "blobs"), FileSpool(folder / "spool")
        super().__init__(names, parts_on(store, blobs=blobs, spool=spool, ids=SystemIds()), seed=seed, folder=folder)

    def harness(self) -> Harness:
        """The harness over these robots."""
        return harness_over(self.connections, self.parts)

    def link(self, name: str) -> WiredRobot:
        """The link over which a robot is reached."""
        robot, self.links[name] = self.robots[name], CutLink(self.clocks[name])
        return WiredRobot(lambda: robot, self.links[name])
