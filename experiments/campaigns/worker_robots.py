"""Holds what one worker of the shared database owns: its shift, its store, and robots that outlive the harness
above them.
"""

from collections.abc import Sequence
from dataclasses import replace

from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.pictures import PICTURES
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.adapters.stores.postgres import PostgresEventStore
from harness.bootstrap import Harness, NullSignals, Parts, local_services, runtime_on
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.ports import Batch, Clock, LogHead, Provider, Record
from harness.contracts.regularities import HiddenSite
from harness.contracts.values import Moment, Value
from harness.projections.mission import Mission
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.supervisor import Supervisor
from harness.supervisor.teleoperation import Teleoperation
from simulator.camera import CAMERA
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings

BASE = "mobile_base"


class Shift(Value):
    """The work of one worker, and its database. `robots` are its own, `fleet` is shared. `folder` holds ENOUGH."""

    url: str
    folder: str
    number: int
    seeds: tuple[int, ...]
    robots: tuple[str, ...]
    fleet: tuple[str, ...]


class AcknowledgedStore(PostgresEventStore):
    """The log in the shared database; it records which appends were answered."""

    def __init__(self, url: str, acknowledged: list[tuple[int, str]]) -> None:
        super().__init__(url)
        self._acknowledged = acknowledged

    def append(self, batches: Sequence[Batch], records: Sequence[Record], now: Moment) -> LogHead:
        """The store's append."""
        head = super().append(batches, records, now)
        self._acknowledged.append((head.position, head.digest))
        return head


class Robots:
    """The robots of one worker with their clocks; they outlive the harness that commands them."""

    def __init__(self, shift: Shift) -> None:
        self._parts = Parts(
            store=MemoryEventStore(),
            blobs=MemoryBlobStore(),
            spool=MemorySpool(),
            ids=SeededIds(shift.seeds[0]),
            clock=LockstepClock(lambda until_s: until_s, at_s=0.0),
            signals=NullSignals(),
        )
        settings = WorldSettings(seed=shift.seeds[0], hidden=HiddenSite(name="nothing", regularities=()))
        self.robots = {name: SimulatedRobot(settings, robot_id=name) for name in shift.robots}
        self.clocks = {name: LockstepClock(one.advance_to, at_s=one.at_s) for name, one in self.robots.items()}
        self.connections = {RobotId(name): self._connection(name) for name in shift.robots}

    def harness(self, store: AcknowledgedStore) -> Harness:
        """One harness over these robots on that log."""
        clocks: dict[RobotId, Clock] = {robot_id: connection.clock for robot_id, connection in self.connections.items()}
        clock = next(iter(clocks.values()))
        runtime = runtime_on(replace(self._parts, store=store, clock=clock), clocks)
        return Harness(
            runtime=runtime,
            supervisor=Supervisor(runtime=runtime, connections=self.connections),
            robots={robot_id: connection.robot for robot_id, connection in self.connections.items()},
            clock=clock,
            teleoperation=Teleoperation(runtime=runtime, connections=self.connections),
            clocks=clocks,
            cameras={},
        )

    def again(self, harness: Harness) -> Harness:
        """The harness with a new supervisor, which finds open work in the log."""
        return replace(harness, supervisor=Supervisor(runtime=harness.runtime, connections=self.connections))

    def _connection(self, name: str) -> RobotConnection:
        robot, clock = self.robots[name], self.clocks[name]

        def configure(mission: Mission) -> None:
            faults = [fault for fault in mission.labels.get("faults", "").split(",") if fault]
            robot.configure(mission.mission_id, mission.seed, parse_faults(faults))

        beside = local_services(replace(self._parts, clock=clock), camera=CAMERA, folder=None, room=robot.room)
        providers: tuple[Provider, ...] = (*robot.providers(), *beside.providers)
        return RobotConnection(
            robot_id=RobotId(name),
            robot=robot,
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
