"""The ROS 2 message types that evidence is read from, as DDS has them: names and fields of their IDL."""

from typing import Any

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl

from harness.adapters.providers.topics import ros_messages

_ARRAY: Any = idl.array
_SEQUENCE: Any = idl.sequence
_FLOATS, _BYTES, _COVARIANCE = _SEQUENCE[idl.float32], _SEQUENCE[idl.uint8], _ARRAY[idl.float64, 36]


def _type(name: str, **fields: Any) -> Any:
    """One ROS 2 type, such as `nav_msgs/msg/Odometry`, under the name that ROS 2 gives it on DDS."""
    package, _, kind = name.split("/")
    return make_idl_struct(kind, f"{package}::msg::dds_::{kind}_", fields)


_XYZ = {"x": idl.float64, "y": idl.float64, "z": idl.float64}
_TIME = _type("builtin_interfaces/msg/Time", sec=idl.int32, nanosec=idl.uint32)
_HEADER = _type("std_msgs/msg/Header", stamp=_TIME, frame_id=str)
_POINT = _type("geometry_msgs/msg/Point", **_XYZ)
_VECTOR = _type("geometry_msgs/msg/Vector3", **_XYZ)
_QUATERNION = _type("geometry_msgs/msg/Quaternion", **_XYZ, w=idl.float64)
_POSE = _type("geometry_msgs/msg/Pose", position=_POINT, orientation=_QUATERNION)
_POSE_SPREAD = _type("geometry_msgs/msg/PoseWithCovariance", pose=_POSE, covariance=_COVARIANCE)
_TWIST = _type("geometry_msgs/msg/Twist", linear=_VECTOR, angular=_VECTOR)
_TWIST_SPREAD = _type("geometry_msgs/msg/TwistWithCovariance", twist=_TWIST, covariance=_COVARIANCE)

DDS_TYPES: dict[str, Any] = {
    ros_messages.POSE: _type(ros_messages.POSE, header=_HEADER, pose=_POSE),
    ros_messages.POSE_COVARIANCE: _type(ros_messages.POSE_COVARIANCE, header=_HEADER, pose=_POSE_SPREAD),
    ros_messages.ODOMETRY: _type(
        ros_messages.ODOMETRY, header=_HEADER, child_frame_id=str, pose=_POSE_SPREAD, twist=_TWIST_SPREAD
    ),
    ros_messages.SCAN: _type(
        ros_messages.SCAN,
        header=_HEADER,
        angle_min=idl.float32,
        angle_max=idl.float32,
        angle_increment=idl.float32,
        time_increment=idl.float32,
        scan_time=idl.float32,
        range_min=idl.float32,
        range_max=idl.float32,
        ranges=_FLOATS,
        intensities=_FLOATS,
    ),
    ros_messages.COMPRESSED_IMAGE: _type(ros_messages.COMPRESSED_IMAGE, header=_HEADER, format=str, data=_BYTES),
    ros_messages.BATTERY: _type(
        ros_messages.BATTERY,
        header=_HEADER,
        voltage=idl.float32,
        temperature=idl.float32,
        current=idl.float32,
        charge=idl.float32,
        capacity=idl.float32,
        design_capacity=idl.float32,
        percentage=idl.float32,
        power_supply_status=idl.uint8,
        power_supply_health=idl.uint8,
        power_supply_technology=idl.uint8,
        present=bool,
        cell_voltage=_FLOATS,
        cell_temperature=_FLOATS,
        location=str,
        serial_number=str,
    ),
}
"""By ROS 2 name. Every field must stand here in its order, read or not: DDS sends a message as its bytes in a row."""
