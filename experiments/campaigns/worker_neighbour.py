"""Takes leases on the bases of other workers' robots and releases them, so that dispatches and leases meet in
one log.
"""

from collections.abc import Callable

from experiments.campaigns.chance import one_of
from experiments.campaigns.mission_course import ELSEWHERE
from experiments.campaigns.shift_missions import BASE
from experiments.campaigns.worker_robots import Shift
from harness.contracts.commands import AcquireLease, LeaseCommand, ReleaseLease
from harness.contracts.decisions import Accepted
from harness.contracts.ids import InvocationId, ResourceId, RobotId, lease_stream, leased
from harness.gate.commit import CommandEnvelope
from harness.runtime import Runtime

FAR_S = 4e9
EVERY = 3
"""After so many turns a base is taken, or the one that was taken is given back."""


class Neighbour:
    """Takes one base of the fleet at a time. `runtime` is looked up at each turn, because it may have been reopened.

    `taken` and `refused` count its requests. Every turn may raise StoreUnavailable; the next one reads the log.
    """

    def __init__(self, shift: Shift, runtime: Callable[[], Runtime]) -> None:
        self._shift, self._runtime = shift, runtime
        self._turns = self.taken = self.refused = 0
        self._borrowed: tuple[ResourceId, InvocationId] | None = None

    @property
    def holds(self) -> bool:
        """Whether it may still hold a base."""
        return self._borrowed is not None

    def turn(self) -> None:
        """Now and then, take a lease or release it."""
        self._turns += 1
        if self._turns % EVERY:
            return
        if self._borrowed is None:
            self._take()
        else:
            self.give_back()

    def give_back(self) -> None:
        """Release what it holds by the log; no effect if it holds nothing."""
        if self._borrowed is None:
            return
        resource, mine = self._borrowed
        lease = self._runtime().lease(resource)
        if lease.status == "held" and lease.invocation_id == mine:
            self._ask(resource, ReleaseLease(invocation_id=mine, reason="given back"))
        self._borrowed = None

    def _take(self) -> None:
        name = one_of(self._shift.seeds[0], self._shift.fleet, "neighbour", self._turns)
        resource = leased(RobotId(name), BASE)
        mine = InvocationId(f"inv_neighbour_{self._shift.number}_{self._turns}")
        token = self._runtime().lease(resource).token + 1
        self._borrowed = (resource, mine)
        take = AcquireLease(resource=resource, mission_id=ELSEWHERE, invocation_id=mine, token=token, expires_s=FAR_S)
        taken = self._ask(resource, take)
        self.taken += taken
        self.refused += not taken

    def _ask(self, resource: ResourceId, command: LeaseCommand) -> bool:
        return isinstance(self._runtime().commit([CommandEnvelope(lease_stream(resource), command, None)]), Accepted)
