"""Builds the ROS 2 messages that the writer stores in a recording, from contract samples."""

import math
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from harness.adapters.providers.recording import messages
from harness.adapters.providers.recording.topics import StaticTransform
from harness.adapters.providers.recording.transforms import Matrix, apply
from harness.contracts.observations import Odometry, Pose
from harness.contracts.values import Point

_INFO = 20
_FLOAT32 = 7


class RosMessageTypes:
    """Builds and serialises the message types of a mission recording."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_JAZZY)
        types = self._store.types
        self._stamp = types["builtin_interfaces/msg/Time"]
        self._header = types["std_msgs/msg/Header"]
        self._point = types["geometry_msgs/msg/Point"]
        self._quaternion = types["geometry_msgs/msg/Quaternion"]
        self._pose_type = types["geometry_msgs/msg/Pose"]
        self._vector = types["geometry_msgs/msg/Vector3"]
        self._types = types

    def definition(self, kind: str) -> str:
        """The complete text of a message definition, as MCAP stores it."""
        return str(self._store.generate_msgdef(kind, ros_version=2)[0])

    def serialised(self, message: Any, kind: str) -> bytes:
        return bytes(self._store.serialize_cdr(message, kind))

    def pose(self, pose: Pose) -> bytes:
        message = self._stamped(pose.at_s, pose.frame, (pose.x_m, pose.y_m), pose.yaw_rad)
        return self.serialised(message, messages.POSE)

    def spatial_pose(
        self, at_ns: int, position: tuple[float, float, float], turn: tuple[float, float, float, float]
    ) -> bytes:
        """A pose in space in a frame that nobody named."""
        header = self._header(stamp=self._stamp(sec=at_ns // 10**9, nanosec=at_ns % 10**9), frame_id="")
        pose = self._pose_type(
            position=self._point(**dict(zip("xyz", position, strict=True))),
            orientation=self._quaternion(**dict(zip("xyzw", turn, strict=True))),
        )
        return self.serialised(self._types[messages.POSE](header=header, pose=pose), messages.POSE)

    def odometry(self, sample: Odometry) -> bytes:
        zeros = np.zeros(36)
        twist = self._types["geometry_msgs/msg/Twist"](
            linear=self._vector(x=sample.v_mps, y=0.0, z=0.0), angular=self._vector(x=0.0, y=0.0, z=sample.w_radps)
        )
        message = self._types[messages.ODOMETRY](
            header=self._headed(sample.at_s, sample.frame),
            child_frame_id="base_link",
            pose=self._types["geometry_msgs/msg/PoseWithCovariance"](
                pose=self._posed((sample.x_m, sample.y_m), sample.yaw_rad), covariance=zeros
            ),
            twist=self._types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=zeros),
        )
        return self.serialised(message, messages.ODOMETRY)

    def path(self, at_s: float, frame: str, points: list[Point]) -> bytes:
        poses = [self._stamped(at_s, frame, point, 0.0) for point in points]
        return self.serialised(self._types[messages.PATH](header=self._headed(at_s, frame), poses=poses), messages.PATH)

    def log(self, at_s: float, speaker: str, text: str) -> bytes:
        message = self._types[messages.LOG](
            stamp=self._timed(at_s), level=_INFO, name=speaker, msg=text, file="", function="", line=0
        )
        return self.serialised(message, messages.LOG)

    def transforms(self, at_s: float, transforms: list[StaticTransform]) -> bytes:
        stamped = [
            self._types["geometry_msgs/msg/TransformStamped"](
                header=self._headed(at_s, one.parent),
                child_frame_id=one.child,
                transform=self._types["geometry_msgs/msg/Transform"](
                    translation=self._vector(**dict(zip("xyz", one.translation_m, strict=True))),
                    rotation=self._quaternion(**dict(zip("xyzw", one.rotation, strict=True))),
                ),
            )
            for one in transforms
        ]
        return self.serialised(self._types[messages.TRANSFORMS](transforms=stamped), messages.TRANSFORMS)

    def image(self, at_s: float, frame: str, body: bytes, kind: str) -> bytes:
        message = self._types[messages.COMPRESSED_IMAGE](
            header=self._headed(at_s, frame), format=kind, data=np.frombuffer(body, dtype=np.uint8)
        )
        return self.serialised(message, messages.COMPRESSED_IMAGE)

    def cloud(self, at_s: float, frame: str, points: Any, *, moved: Matrix) -> bytes:
        """`points` (n, 3) metres, taken through `moved` into `frame`."""
        body = apply(moved, points).astype("<f4").tobytes()
        field = self._types["sensor_msgs/msg/PointField"]
        message = self._types[messages.CLOUD](
            header=self._headed(at_s, frame),
            height=1,
            width=len(points),
            fields=[field(name=name, offset=4 * at, datatype=_FLOAT32, count=1) for at, name in enumerate("xyz")],
            is_bigendian=False,
            point_step=12,
            row_step=12 * len(points),
            data=np.frombuffer(body, dtype=np.uint8),
            is_dense=True,
        )
        return self.serialised(message, messages.CLOUD)

    def _timed(self, at_s: float) -> Any:
        at_ns = nanoseconds(at_s)
        return self._stamp(sec=at_ns // 10**9, nanosec=at_ns % 10**9)

    def _headed(self, at_s: float, frame: str) -> Any:
        return self._header(stamp=self._timed(at_s), frame_id=frame)

    def _posed(self, at: Point, yaw_rad: float) -> Any:
        turn = self._quaternion(x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2))
        return self._pose_type(position=self._point(x=at[0], y=at[1], z=0.0), orientation=turn)

    def _stamped(self, at_s: float, frame: str, at: Point, yaw_rad: float) -> Any:
        return self._types[messages.POSE](header=self._headed(at_s, frame), pose=self._posed(at, yaw_rad))


def nanoseconds(at_s: float) -> int:
    """Seconds of mission time as whole nanoseconds."""
    return round(at_s * 1e9)
