"""What a worker tells the other processes of its site about a robot: for people and never evidence, stored nowhere."""

from harness.contracts.ids import RobotId
from harness.contracts.observations import Pose
from harness.contracts.protocol import RobotStatus
from harness.contracts.values import Name, Value


class RobotReport(Value):
    """A robot as the worker that drives it heard it last, `age_s` before this was sent.

    `took_s`: how long the robot took to answer; `trouble`: why it did not answer the newest question. `pose` is its
    localiser's newest, `pose_age_s` old by the robot's own time when this was sent.
    """

    worker: Name
    robot_id: RobotId
    status: RobotStatus | None = None
    age_s: float | None = None
    took_s: float = 0.0
    trouble: str = ""
    pose: Pose | None = None
    pose_age_s: float = 0.0
