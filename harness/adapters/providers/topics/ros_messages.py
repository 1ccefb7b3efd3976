"""The shapes of ROS messages as JSON carries them; messages of CDR have the same field names, and are read alike."""

import base64
import binascii
from typing import Any, Literal, get_args

import msgspec

from harness.contracts.errors import ProviderFailed
from harness.contracts.reasons import because

Role = Literal["pose", "odometry", "scan", "image", "battery"]
ROLES: tuple[Role, ...] = get_args(Role)
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
SCAN = "sensor_msgs/msg/LaserScan"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
BATTERY = "sensor_msgs/msg/BatteryState"
TYPES: dict[Role, tuple[str, ...]] = {
    "pose": (POSE, POSE_COVARIANCE, ODOMETRY),
    "odometry": (ODOMETRY,),
    "scan": (SCAN,),
    "image": (COMPRESSED_IMAGE,),
    "battery": (BATTERY,),
}
"""The message types that each role can be read from."""


class Stamp(msgspec.Struct, frozen=True):
    """A time of ROS 2; ROS 1 names the two fields otherwise."""

    sec: int = 0
    nanosec: int = 0
    secs: int = 0
    nsecs: int = 0


class Header(msgspec.Struct, frozen=True):
    stamp: Stamp
    frame_id: str = ""


class Triple(msgspec.Struct, frozen=True):
    x: float
    y: float
    z: float = 0.0


class Quaternion(msgspec.Struct, frozen=True):
    x: float
    y: float
    z: float
    w: float


class SpatialPose(msgspec.Struct, frozen=True):
    position: Triple
    orientation: Quaternion


class PoseWithCovariance(msgspec.Struct, frozen=True):
    pose: SpatialPose
    covariance: tuple[float | None, ...] = ()


class Twist(msgspec.Struct, frozen=True):
    linear: Triple
    angular: Triple


class TwistWithCovariance(msgspec.Struct, frozen=True):
    twist: Twist


class PoseMessage(msgspec.Struct, frozen=True):
    header: Header
    pose: SpatialPose


class PoseCovarianceMessage(msgspec.Struct, frozen=True):
    header: Header
    pose: PoseWithCovariance


class OdometryMessage(msgspec.Struct, frozen=True):
    header: Header
    pose: PoseWithCovariance
    twist: TwistWithCovariance
    child_frame_id: str = ""


class ScanMessage(msgspec.Struct, frozen=True):
    """A range that JSON cannot carry, not a number or infinite, comes as null."""

    header: Header
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: tuple[float | None, ...]


class ImageMessage(msgspec.Struct, frozen=True):
    """`data` in base64, as JSON carries bytes."""

    header: Header
    data: str
    format: str = ""


class BatteryMessage(msgspec.Struct, frozen=True):
    header: Header
    percentage: float | None = None


SHAPES: dict[str, type[msgspec.Struct]] = {
    POSE: PoseMessage,
    POSE_COVARIANCE: PoseCovarianceMessage,
    ODOMETRY: OdometryMessage,
    SCAN: ScanMessage,
    COMPRESSED_IMAGE: ImageMessage,
    BATTERY: BatteryMessage,
}


def full_name(name: str) -> str:
    """The ROS 2 name of a type; ROS 1 leaves the `msg` out."""
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") else f"{package}/msg/{rest}"


def of_json(body: bytes | msgspec.Raw, kind: str, *, topic: str) -> Any:
    """A message as an object with its ROS field names. Raises ProviderFailed for one that is none of its type."""
    try:
        return msgspec.json.decode(body, type=SHAPES[kind])
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise ProviderFailed(because("topic_message_unusable", topic=topic, error=str(error)[:200])) from error


def stamp_s(message: Any) -> float:
    """The header's stamp, seconds; 0 where the publisher left it empty."""
    stamp = message.header.stamp
    seconds = stamp.sec or getattr(stamp, "secs", 0)
    nanoseconds = stamp.nanosec or getattr(stamp, "nsecs", 0)
    return float(seconds) + float(nanoseconds) * 1e-9


def image_bytes(message: Any) -> bytes:
    """The encoded picture; empty where it is none."""
    if not isinstance(message.data, str):
        return bytes(message.data)
    try:
        return base64.b64decode(message.data, validate=True)
    except (binascii.Error, ValueError):
        return b""
