"""Holds the robots of one worker of the fleet campaign, each with a folder that outlives the worker's process."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from experiments.campaigns.plan import Disturbance, DisturbanceName
from experiments.campaigns.shift_robots import connected, harness_over, world
from experiments.campaigns.wire import WiredRobot
from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SystemIds
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.spool import FileSpool
from harness.bootstrap import Harness, NullSignals, Parts
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import RobotId
from harness.contracts.ports import Clock, EventStore
from harness.supervisor.robot_connection import RobotConnection
from simulator.robot import SimulatedRobot

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


class FleetRobots:
    """The robots by name, their clocks and links, on the files of `folder`."""

    def __init__(self, names: tuple[str, ...], folder: Path, *, seed: int, store: EventStore) -> None:
        self._folder = folder
        self._parts = Parts(
            store=store,
            blobs=FileBlobStore(folder / "blobs"),
            spool=FileSpool(folder / "spool"),
            ids=SystemIds(),
            clock=LockstepClock(lambda until_s: until_s, at_s=0.0),
            signals=NullSignals(),
        )
        self.robots = {name: SimulatedRobot(world(seed), self.folder_of(name), robot_id=name) for name in names}
        self.clocks = {name: LockstepClock(one.advance_to, at_s=one.at_s) for name, one in self.robots.items()}
        self.links = {name: CutLink(clock) for name, clock in self.clocks.items()}
        self._connections = {RobotId(name): self._connection(name) for name in names}

    def folder_of(self, name: str) -> Path:
        """Where a robot keeps its journals, its world and the truth."""
        return self._folder / "robots" / name

    def harness(self) -> Harness:
        """The harness over these robots."""
        return harness_over(self._connections, self._parts)

    def _connection(self, name: str) -> RobotConnection:
        robot = self.robots[name]
        wired = WiredRobot(lambda: robot, self.links[name])
        return connected(robot, self.clocks[name], self._parts, link=wired, folder=self._folder)
