"""The interface of a robot skill: its own perception in, a velocity and an outcome out."""

from collections.abc import Callable
from typing import Literal, Protocol

import msgspec

from harness.contracts.ids import Digest, RequestId, sha256
from harness.contracts.reasons import Reason
from harness.contracts.values import Value
from simulator.bodies import Floats, Velocity


class Draft(Value):
    """A receipt without the identity that the invocation gives it. `body` are bytes that it rests on, if any."""

    kind: Literal["rotation", "capture", "arrival", "disarm"]
    at_s: float
    text: str
    blob: Digest | None = None
    values: dict[str, float] = msgspec.field(default_factory=dict)
    body: bytes = b""


class Shot(Value):
    """A captured frame: its bytes' digest, its sample's sequence number, its instant."""

    blob: Digest
    seq: int
    at_s: float


class Outcome(Value):
    """How a skill ended, by its own report."""

    status: Literal["succeeded", "failed"]
    failure: str = ""
    message: Reason | None = None
    declared: dict[str, float] = msgspec.field(default_factory=dict)


class Perception(msgspec.Struct):
    """The robot's own view this tick: mission time, estimated pose in its map, odometry's twist, lidar, camera."""

    at_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    still: bool
    ranges: Callable[[Floats, float], Floats]
    capture: Callable[[float, RequestId], Shot]
    keep: Callable[[bytes], Digest] = sha256
    frame: str = ""
    map_version: str = ""


class Step(msgspec.Struct, frozen=True):
    """One tick of a skill: the velocity it wants, whether it is held up, receipts it earned, how it ended."""

    command: Velocity = Velocity()
    blocked: Reason | None = None
    drafts: tuple[Draft, ...] = ()
    shots: tuple[Shot, ...] = ()
    outcome: Outcome | None = None


class Skill(Protocol):
    """One running skill. It sees nothing but `Perception`."""

    @property
    def share(self) -> float:
        """Progress from 0 to 1."""

    @property
    def remaining_m(self) -> float | None:
        """Metres of route still to go, where that means something."""

    def step(self, perception: Perception) -> Step:
        """One tick; not called again after an outcome."""

    def resume(self, at_s: float) -> None:
        """Go on after the robot was held still from outside; waiting does not count as lack of progress."""
