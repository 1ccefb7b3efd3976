"""A robot that only says how it is: its samples and its bytes must come from elsewhere."""

from collections.abc import Sequence

from harness.contracts import protocol
from harness.contracts.ids import Digest
from harness.contracts.ports import Provider

NOW_S = 1_700_000_000.0


class DeclaringRobot:
    """What the robot's own program says of it: localised, standing, full."""

    def __init__(self) -> None:
        self.condition = protocol.RobotStatus(
            robot_id="robot-1", at_s=NOW_S, posture="standing", armed=False, hardware_stop=False, charge=1.0,
            localised=True, map_version="hall-1", pose_age_s=0.0,
        )  # fmt: skip

    def providers(self) -> Sequence[Provider]:
        return ()

    def status(self) -> protocol.RobotStatus:
        return self.condition

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        raise AssertionError("samples come from the topics alone")

    def blob(self, digest: Digest) -> bytes:
        raise AssertionError("bytes come from the topics alone")

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return ()
