"""Admission of robots: what the conformance kit found at an address, and who let it be used (D55)."""

from typing import Annotated

import msgspec

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.ids import Digest, ProviderId, RobotId, StreamId
from harness.contracts.values import Name, Value

ADMISSIONS = "admission/"
MOST_PROVIDERS = 256


class CheckedProvider(Value):
    """The kit's result for one provider. `card` is the digest of the card that was tried; rows by their names."""

    provider_id: ProviderId
    version: Name
    capability: Name
    card: Digest
    moves: bool
    met: tuple[Name, ...]
    not_met: tuple[Name, ...] = ()
    exempt: tuple[Name, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether something was tried, and every row is met or exempt."""
        return bool(self.met) and not self.not_met


CheckResults = Annotated[tuple[CheckedProvider, ...], msgspec.Meta(min_length=1, max_length=MOST_PROVIDERS)]


class RecordCheck(Command, tag=True):
    """Record what the kit found at `address`. `result` is the blob with every row and what was observed.

    `stands_clear`: a person said that nobody is near the robot; rows that move it need that.
    """

    actor: Actor
    robot_id: RobotId
    address: Name
    checked: CheckResults
    result: Digest
    stands_clear: bool
    reason: Name


class RobotChecked(Event, tag=True):
    """From here on these providers are used with exactly these cards at this address, where every row was met."""

    actor: Actor
    robot_id: RobotId
    address: Name
    checked: CheckResults
    result: Digest
    stands_clear: bool
    reason: Name
    at_s: float


def admission_stream(robot_id: RobotId) -> StreamId:
    """The stream of one robot's checks."""
    return StreamId(f"{ADMISSIONS}{robot_id}")
