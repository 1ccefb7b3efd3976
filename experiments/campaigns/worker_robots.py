"""Holds what one worker of the shared database owns: its shift, and robots that outlive the harness above them."""

from dataclasses import replace

from experiments.campaigns.shift_robots import ShiftRobots, harness_over, parts_on
from harness.adapters.ids import SeededIds
from harness.adapters.stores.memory import MemoryBlobStore, MemoryEventStore, MemorySpool
from harness.bootstrap import Harness
from harness.contracts.ports import EventStore
from harness.contracts.values import Value
from harness.supervisor.supervisor import Supervisor


class Shift(Value):
    """The work of one worker, and its database. `robots` are its own, `fleet` is shared. `folder` holds ENOUGH."""

    url: str
    folder: str
    number: int
    seeds: tuple[int, ...]
    robots: tuple[str, ...]
    fleet: tuple[str, ...]


class Robots(ShiftRobots):
    """The robots of one worker, beside it and in memory."""

    def __init__(self, shift: Shift) -> None:
        seed = shift.seeds[0]
        blobs, spool = MemoryBlobStore(), MemorySpool()
        parts = parts_on(MemoryEventStore(), blobs=blobs, spool=spool, ids=SeededIds(seed))
        super().__init__(shift.robots, parts, seed=seed)

    def harness(self, store: EventStore) -> Harness:
        """One harness over these robots on that log."""
        clock = next(iter(self.connections.values())).clock
        return harness_over(self.connections, replace(self.parts, store=store, clock=clock))

    def again(self, harness: Harness) -> Harness:
        """The harness with a new supervisor, which finds open work in the log."""
        return replace(harness, supervisor=Supervisor(runtime=harness.runtime, connections=self.connections))
