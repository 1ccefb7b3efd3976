"""Runs the simulator inside the process of a suite or test: implements `contracts.simulation.Simulator`."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from harness.contracts.ids import Digest, MissionId, sha256
from harness.contracts.regularities import HiddenSite
from harness.contracts.simulation import Fidelity, InProcessRobot, TruePosition
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.teleoperation import SimulatedTeleoperation
from simulator.world import WorldSettings


@dataclass(frozen=True)
class InProcessSimulator:
    """Makes robots in this process. It holds nothing, so that it can be sent to worker processes."""

    def robot(
        self, robot_id: str, *, seed: int, fidelity: Fidelity, hidden: HiddenSite | None = None
    ) -> InProcessRobot:
        """A new robot in a world of its own; `hidden` are the recurring disturbances of its site."""
        robot = SimulatedRobot(WorldSettings(fidelity=fidelity, seed=seed, hidden=hidden), robot_id=robot_id)

        def configure(mission_id: MissionId, mission_seed: int, faults: Sequence[str]) -> None:
            robot.configure(mission_id, mission_seed, parse_faults(faults))

        return InProcessRobot(
            robot_id=robot_id,
            robot=robot,
            at_s=robot.at_s,
            advance_to=robot.advance_to,
            configure=configure,
            camera=robot,
            hand=SimulatedTeleoperation(robot),
            room=robot.room,
            truth=lambda: [TruePosition(one.at_s, one.x_m, one.y_m) for one in robot.world.truth.records],
        )

    def check_faults(self, names: Sequence[str]) -> None:
        """Raise UnknownName for a fault that the simulator does not know."""
        parse_faults(names)

    def sources(self) -> Digest:
        """Names the simulator by the names and contents of its modules."""
        return _sources()


SIMULATOR = InProcessSimulator()


@cache
def _sources() -> Digest:
    modules = sorted(
        (one for one in files("simulator").iterdir() if one.name.endswith(".py")), key=lambda one: one.name
    )
    return sha256(b"".join(one.name.encode() + b"\n" + one.read_bytes() for one in modules))
