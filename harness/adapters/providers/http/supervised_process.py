"""Supervises a robot process: restarts it when it dies and configures it again for the mission that is running."""

from collections.abc import Sequence
from threading import Lock

from harness.adapters.clock import LockstepClock, RobotClock
from harness.adapters.providers.http.process import RobotProcess, RobotSettings
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts.errors import ProviderUnreachable
from harness.contracts.ids import MissionId
from harness.contracts.ports import Clock


class SupervisedProcess:
    """One robot process with its client and its clock. Raises as RobotProcess does when it does not come up."""

    def __init__(self, settings: RobotSettings) -> None:
        self._process = RobotProcess(settings)
        self._under_way: tuple[MissionId, int, tuple[str, ...]] | None = None
        self._reviving = Lock()
        self.robot_id = settings.robot_id
        self.robot: HttpRobot = self._process.robot
        self.clock: Clock = (
            RobotClock(lambda: self.robot.clock().at_s, settings.speed)
            if settings.speed
            else LockstepClock(self._advance, at_s=self.robot.clock().at_s)
        )

    def configure(self, mission_id: MissionId, seed: int, faults: Sequence[str]) -> None:
        """Begin a mission on it; a robot that is restarted later is configured the same way."""
        self._under_way = (mission_id, seed, tuple(faults))
        try:
            self.robot.configure(mission_id, seed, faults)
        except ProviderUnreachable:
            if not self.revive():
                raise

    def revive(self) -> bool:
        """Start a dead process again, as a service manager would; its world goes on where it was saved.

        Its clock advances by the time it was down: a mission does not wait.
        """
        with self._reviving:
            if not self._process.revive(from_s=self.clock.now().mission_s):
                return False
            if self._under_way is not None:
                self.robot.configure(*self._under_way)
            return True

    def close(self) -> None:
        """End the process in order: its world is saved."""
        self.robot.close()
        self._process.terminate()

    def _advance(self, until_s: float) -> float:
        try:
            return self.robot.advance(until_s)
        except ProviderUnreachable:
            if not self.revive():
                raise
            return self.robot.advance(until_s)
