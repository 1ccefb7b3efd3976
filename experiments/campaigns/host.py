"""Hosts the simulated robot of one campaign mission; it may die during the mission and restart from its saved state."""

from collections import Counter
from pathlib import Path

from experiments.campaigns.plan import MissionPlan
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import MissionId
from harness.contracts.protocol import PhysicalStart
from harness.contracts.values import decode
from simulator.faults import parse_faults
from simulator.journals import StartJournal
from simulator.robot import SimulatedRobot
from simulator.truth import Truth
from simulator.world import EPOCH_S, WorldSettings

PICTURES = Path(__file__).resolve().parents[2] / ".bench" / "pictures"
"""Pictures that an earlier mission took at the same place, of the same site and by the same code."""


class RobotHost:
    """One robot in this process. `folder` is needed only where the robot dies: its journal survives there."""

    def __init__(self, plan: MissionPlan, folder: Path | None, struck: Counter[str]) -> None:
        self._plan, self._folder, self._struck = plan, folder, struck
        self._settings = WorldSettings(fidelity="kinematic", seed=plan.seed, pictures=str(PICTURES))
        self._robot: SimulatedRobot | None = SimulatedRobot(self._settings, folder)
        self.at_s = EPOCH_S
        self._down_until_s = 0.0
        self._mission: MissionId | None = None
        self._crashes = [one for one in plan.disturbances if one.name == "robot-crash"]

    def __call__(self) -> SimulatedRobot:
        """The robot; raises ProviderUnreachable while it is down."""
        if self._robot is None:
            raise ProviderUnreachable("The robot's process is gone", where="vbot-1", do="start it again")
        return self._robot

    def configure(self, mission_id: MissionId) -> None:
        """The mission begins, or continues with a restarted robot."""
        self._mission = mission_id
        self().configure(mission_id, self._plan.seed, parse_faults(self._plan.faults))

    def advance(self, until_s: float) -> float:
        """Let time pass, with or without the robot; returns the time reached."""
        if self._crashes and until_s >= EPOCH_S + self._crashes[0].at_s and self._robot is not None:
            crash = self._crashes.pop(0)
            self._down_until_s = self.at_s + crash.for_s
            self._robot.world.truth.close()
            self._robot = None
            self._struck["robot-crash"] += 1
        self.at_s = max(self.at_s, until_s) if self._robot is None else self._robot.advance_to(until_s)
        return self.at_s

    def revive(self) -> bool:
        """Restart a robot that is down once its time is over, as a service manager would."""
        if self._robot is not None or self.at_s < self._down_until_s:
            return False
        self._robot = SimulatedRobot(self._settings, self._folder)
        self._robot.advance_to(self.at_s)
        if self._mission is not None:
            self.configure(self._mission)
        return True

    def starts(self) -> tuple[PhysicalStart, ...]:
        """The robot's own start journal: from its process, or from its folder where the process is gone."""
        if self._robot is not None:
            return tuple(self._robot.starts())
        return StartJournal(self._folder and self._folder / "starts.jsonl").all()

    def faults_struck(self) -> dict[str, int]:
        """How often each fault of the robot really struck since it was last started."""
        return self._robot.struck() if self._robot is not None else {}

    def close(self) -> None:
        """Release the files in the folder."""
        if self._robot is not None:
            self._robot.world.truth.close()

    def truth(self) -> tuple[Truth, ...]:
        """Everything that truly happened, in order of time."""
        if self._folder is None:
            return tuple(self().world.truth.records)
        files = sorted((self._folder / "truth").glob("*.jsonl"))
        lines = (line for file in files for line in file.read_bytes().splitlines())
        return tuple(sorted((decode(line, Truth) for line in lines), key=lambda truth: truth.at_s))
