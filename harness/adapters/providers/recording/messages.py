"""Decodes ROS 1 and ROS 2 messages with the definitions that the recording itself carries."""

import struct
from collections.abc import Callable
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from harness.adapters.providers.recording.raw_messages import Channel, Raw
from harness.contracts.errors import RecordingInvalid
from harness.contracts.reasons import because

ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
PATH = "nav_msgs/msg/Path"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
LOG = "rcl_interfaces/msg/Log"
LOG_ROS1 = "rosgraph_msgs/msg/Log"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CLOUD = "sensor_msgs/msg/PointCloud2"
_IDL_RULE = "=" * 80 + "\n"


class Decoder:
    """Decodes messages of one recording; definitions in the file win over the well-known ones."""

    def __init__(self, *, where: str) -> None:
        self._where = where
        self._known: dict[Channel, Callable[[bytes], Any]] = {}

    def decode(self, raw: Raw) -> Any:
        """The message as an object with its ROS field names; raises RecordingInvalid."""
        reader = self._known.get(raw.channel)
        if reader is None:
            reader = self._known[raw.channel] = self._reader(raw.channel)
        try:
            return reader(raw.body)
        except Exception as error:
            raise RecordingInvalid(
                because("message_undecodable", type=raw.channel.type, topic=raw.channel.topic, error=str(error)),
                where=because("at_log_time", path=self._where, log_s=raw.log_ns / 1e9),
            ) from error

    def _reader(self, channel: Channel) -> Callable[[bytes], Any]:
        if channel.encoding not in ("cdr", "ros1"):
            raise RecordingInvalid(
                because("topic_encoding_unknown", topic=channel.topic, encoding=channel.encoding), where=self._where
            )
        store = self._store(channel)
        read = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
        return lambda body: read(body, channel.type)

    def _store(self, channel: Channel) -> Any:
        if not channel.definition:
            known = get_typestore(Stores.ROS1_NOETIC if channel.encoding == "ros1" else Stores.ROS2_JAZZY)
            if channel.type in known.fielddefs:
                return known
            raise RecordingInvalid(
                because("topic_definition_missing", topic=channel.topic, type=channel.type or "?"), where=self._where
            )
        own = get_typestore(Stores.EMPTY)
        try:
            own.register(_parsed(channel))
            own.get_msgdef(channel.type)
        except Exception as error:
            raise RecordingInvalid(
                because("topic_definition_unusable", type=channel.type, topic=channel.topic, error=str(error)),
                where=self._where,
            ) from error
        return own


def stamp_ns(raw: Raw) -> int:
    """Header stamp of a message whose first field is a std_msgs/Header, nanoseconds, without decoding the rest.

    0 if the publisher left it empty. Raises RecordingInvalid if the body is too short to hold one.
    """
    try:
        if raw.channel.encoding == "ros1":
            seconds, nanoseconds = struct.unpack_from("<II", raw.body, 4)
        else:
            seconds, nanoseconds = struct.unpack_from("<iI" if raw.body[1] else ">iI", raw.body, 4)
    except (struct.error, IndexError) as error:
        raise RecordingInvalid(because("message_too_short", topic=raw.channel.topic, log_s=raw.log_ns / 1e9)) from error
    return int(seconds) * 10**9 + int(nanoseconds)


def _parsed(channel: Channel) -> Any:
    if channel.schema_encoding not in ("ros2idl", "omgidl"):
        return get_types_from_msg(channel.definition, channel.type)
    types: dict[str, Any] = {}
    for part in channel.definition.split(_IDL_RULE):
        head, _, rest = part.partition("\n")
        types |= get_types_from_idl(rest if head.startswith("IDL: ") else part) if part.strip() else {}
    return types
