"""Holds what one worker of the shared database owns: its shift, its store, and robots that outlive the harness
above them.
"""

from collections.abc import Sequence
from dataclasses import replace

from experiments.campaigns.shift_robots import connected, harness_over, world
from harness.adapters.clock import LockstepClock
from harness.adapters.ids import SeededIds
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.adapters.stores.postgres import PostgresEventStore
from harness.bootstrap import Harness, NullSignals, Parts
from harness.contracts.ids import RobotId
from harness.contracts.ports import Batch, LogHead, Record
from harness.contracts.values import Moment, Value
from harness.supervisor.supervisor import Supervisor
from simulator.robot import SimulatedRobot

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
        settings = world(shift.seeds[0])
        self.robots = {name: SimulatedRobot(settings, robot_id=name) for name in shift.robots}
        self.clocks = {name: LockstepClock(one.advance_to, at_s=one.at_s) for name, one in self.robots.items()}
        self.connections = {
            RobotId(name): connected(one, self.clocks[name], self._parts, folder=None)
            for name, one in self.robots.items()
        }

    def harness(self, store: AcknowledgedStore) -> Harness:
        """One harness over these robots on that log."""
        clock = next(iter(self.connections.values())).clock
        return harness_over(self.connections, replace(self._parts, store=store, clock=clock))

    def again(self, harness: Harness) -> Harness:
        """The harness with a new supervisor, which finds open work in the log."""
        return replace(harness, supervisor=Supervisor(runtime=harness.runtime, connections=self.connections))
