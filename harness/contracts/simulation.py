"""The port through which suites and tests run a simulated robot in their own process, independent of the simulator."""

from collections.abc import Callable, Sequence
from typing import Literal, Protocol

import msgspec

from harness.contracts.ids import Digest, MissionId
from harness.contracts.ports import LiveCamera, Robot, Room, Teleoperable
from harness.contracts.regularities import HiddenSite

Fidelity = Literal["mujoco", "kinematic", "walking"]


class TruePosition(msgspec.Struct, frozen=True):
    """Where the body truly was at a mission time: metres in the site's frame. Only an adjudicator may see it."""

    at_s: float
    x_m: float
    y_m: float


class InProcessRobot(msgspec.Struct, frozen=True):
    """A simulated robot in this process. Its mission time starts at `at_s` and advances only by `advance_to`.

    `advance_to` returns the mission time reached, in seconds. `configure` begins a mission with its seed and faults; it
    raises UnknownName for a fault that the simulator does not know. `truth` is of the mission under way, in order.
    """

    robot_id: str
    robot: Robot
    at_s: float
    advance_to: Callable[[float], float]
    configure: Callable[[MissionId, int, Sequence[str]], None]
    camera: LiveCamera
    hand: Teleoperable
    room: Room
    truth: Callable[[], Sequence[TruePosition]]


class Simulator(Protocol):
    """Creates simulated robots. The program's entry point passes it in: the harness and the reviews name no
    simulator."""

    def robot(
        self, robot_id: str, *, seed: int, fidelity: Fidelity, hidden: HiddenSite | None = None
    ) -> InProcessRobot:
        """A new robot in its own world; `hidden` are the recurring disturbances of its site."""

    def check_faults(self, names: Sequence[str]) -> None:
        """Raise UnknownName for a fault that the simulator does not know."""

    def sources(self) -> Digest:
        """Names the simulator by its sources: whatever can change a result changes this."""

    def __hash__(self) -> int:
        """Equal simulators make equal robots, so that a result may be cached under its simulator."""
