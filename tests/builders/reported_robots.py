"""What a robot that another process drives reports: its status and its pose."""

from harness.contracts.ids import RobotId
from harness.contracts.observations import Pose
from harness.contracts.protocol import RobotStatus


def moving(robot_id: RobotId, *, charge: float = 0.5) -> RobotStatus:
    return RobotStatus(
        robot_id=robot_id,
        at_s=5.0,
        posture="moving",
        armed=True,
        hardware_stop=False,
        charge=charge,
        localised=True,
        map_version="site-1",
    )


def pose_at(x_m: float, y_m: float) -> Pose:
    return Pose(seq=1, at_s=5.0, source="localiser", frame="map", map_version="site-1", x_m=x_m, y_m=y_m, yaw_rad=0.1)
