"""The way that the SLAM walked, off paths in every encoding, whatever their frame is called."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from harness.adapters.providers.recording.messages import PATH, POSE
from harness.adapters.providers.recording.reader import open_recording
from harness.contracts.values import Point
from tests.fixtures.recordings import ROS1, mcap_of

BODY_POSE = "/vbot_planner/body_pose"
WALKED: tuple[Point, ...] = ((0.0, 0.0), (1.0, 0.0))
STAGES: tuple[tuple[Point, ...], ...] = (WALKED[:1], WALKED, ())
FRAMES = ("map", "odom", "world", "map_01")
ROS2 = get_typestore(Stores.ROS2_JAZZY)
Write = Callable[[Path, str], Path]


def posed(kinds: Any, header: Any, at: Point) -> Any:
    turn = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    place = kinds["geometry_msgs/msg/Point"](x=at[0], y=at[1], z=0.0)
    return kinds[POSE](header=header, pose=kinds["geometry_msgs/msg/Pose"](position=place, orientation=turn))


def told(store: Any, frame: str, **numbered: int) -> list[tuple[str, str, float, Any]]:
    """One body pose, then a path that grows and comes back empty, a second apart."""
    kinds = store.types
    messages = []
    for at, points in enumerate(STAGES):
        stamp = kinds["builtin_interfaces/msg/Time"](sec=10 + at, nanosec=0)
        header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **numbered)
        if at == 0:
            messages.append((BODY_POSE, POSE, 10.0, posed(kinds, header, WALKED[0])))
        path = kinds[PATH](header=header, poses=[posed(kinds, header, point) for point in points])
        messages.append(("/path", PATH, 10.0 + at, path))
    return messages


def bag(path: Path, frame: str) -> Path:
    """A ROS 1 bag."""
    messages = told(ROS1, frame, seq=1)
    with BagWriter(path) as writer:
        kinds = {topic: kind for topic, kind, _, _ in messages}
        topics = {topic: writer.add_connection(topic, kind, typestore=ROS1) for topic, kind in kinds.items()}
        for topic, kind, at_s, message in messages:
            writer.write(topics[topic], round(at_s * 1e9), bytes(ROS1.serialize_ros1(message, kind)))
    return path


def big_endian(path: Path, frame: str) -> Path:
    """An MCAP of CDR bodies as a machine writes them whose bytes go the other way."""
    bodies = [
        (topic, kind, at_s, bytes(ROS2.serialize_cdr(message, kind, little_endian=False)))
        for topic, kind, at_s, message in told(ROS2, frame)
    ]
    return mcap_of(path, bodies)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("write", [bag, big_endian])
@pytest.mark.ledger("R177", symbol="harness.adapters.providers.recording.survey:_poses_in")
def test_the_final_path_with_poses_is_found_in_every_encoding(write: Write, frame: str, tmp_path: Path) -> None:
    suffix = "bag" if write is bag else "mcap"
    with open_recording(write(tmp_path / f"slam.{suffix}", frame)) as recording:
        found = recording.slam_path()
    assert found is not None
    assert (found.route_m, found.at_s) == (WALKED, pytest.approx(11.0))
