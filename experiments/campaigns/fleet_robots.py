"""Holds the robots of one worker of the fleet campaign, each with a folder that outlives the worker's process."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from experiments.campaigns.plan import Disturbance, DisturbanceName
from experiments.campaigns.wire import WiredRobot
from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SystemIds
from harness.adapters.pictures import PICTURES
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.spool import FileSpool
from harness.bootstrap import Harness, NullSignals, Parts, local_services, runtime_on
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.ports import Clock, EventStore, Provider
from harness.contracts.regularities import HiddenSite
from harness.projections.mission import Mission
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.supervisor import Supervisor
from harness.supervisor.teleoperation import Teleoperation
from simulator.camera import CAMERA
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings

Answer = TypeVar("Answer")


class CutLink:
    """The link to one robot: between two instants of its mission time nothing comes through. Implements Wire."""

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
        settings = WorldSettings(seed=seed, hidden=HiddenSite(name="nothing", regularities=()))
        self.robots = {name: SimulatedRobot(settings, self.folder_of(name), robot_id=name) for name in names}
        self.clocks = {name: LockstepClock(one.advance_to, at_s=one.at_s) for name, one in self.robots.items()}
        self.links = {name: CutLink(clock) for name, clock in self.clocks.items()}
        self._connections = {RobotId(name): self._connection(name) for name in names}

    def folder_of(self, name: str) -> Path:
        """Where a robot keeps its journals, its world and the truth."""
        return self._folder / "robots" / name

    def harness(self) -> Harness:
        """The harness over these robots."""
        clocks: dict[RobotId, Clock] = {robot_id: one.clock for robot_id, one in self._connections.items()}
        runtime = runtime_on(self._parts, clocks)
        return Harness(
            runtime=runtime,
            supervisor=Supervisor(runtime=runtime, connections=self._connections),
            robots={robot_id: one.robot for robot_id, one in self._connections.items()},
            clock=self._parts.clock,
            teleoperation=Teleoperation(runtime=runtime, connections=self._connections),
            clocks=clocks,
            cameras={},
        )

    def _connection(self, name: str) -> RobotConnection:
        robot, clock = self.robots[name], self.clocks[name]
        wired = WiredRobot(lambda: robot, self.links[name])

        def configure(mission: Mission) -> None:
            faults = [fault for fault in mission.labels.get("faults", "").split(",") if fault]
            robot.configure(mission.mission_id, mission.seed, parse_faults(faults))

        beside = local_services(
            Parts(**{**vars(self._parts), "clock": clock}),
            camera=CAMERA,
            folder=self._folder,
            robot_id=name,
            room=robot.room,
        )
        providers: tuple[Provider, ...] = (*wired.providers(), *beside.providers)
        return RobotConnection(
            robot_id=RobotId(name),
            robot=wired,
            providers={ProviderId(one.card.provider_id): one for one in providers},
            clock=clock,
            ids=self._parts.ids,
            spool=self._parts.spool,
            prepare=configure,
            revive=lambda: False,
            pictures=PICTURES,
            waits_for_people=False,
            sources=tuple(beside.sources),
        )
