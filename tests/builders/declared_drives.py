"""Recordings of drives whose supervisor declares success: there, elsewhere, on the move, without a target."""

from pathlib import Path

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from harness.adapters.providers.recording.messages import LOG, ODOMETRY, POSE
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes
from harness.contracts.observations import Odometry
from tests.fixtures.recordings import START_S, mcap_of, pose_at

DROVE_M = 6.0


def rosbag2_drive(folder: Path) -> Path:
    """The same drive as a rosbag2 folder, by its odometry and its poses."""
    words = RosMessageTypes()
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        wheels = writer.add_connection("/odom", ODOMETRY, typestore=store)
        poses = writer.add_connection("/vbot_planner/body_pose", POSE, typestore=store)
        for index in range(200):
            at_s, x_m = START_S + 0.1 * index, min(0.04 * index, DROVE_M)
            sample = Odometry(
                seq=1, at_s=at_s, source="odometry", frame="map", x_m=x_m, y_m=0.0, yaw_rad=0.0,
                v_mps=0.4 if x_m < DROVE_M else 0.0, w_radps=0.0,
            )  # fmt: skip
            writer.write(wheels, round(at_s * 1e9), words.odometry(sample))
            writer.write(poses, round(at_s * 1e9), words.pose(pose_at(at_s, x_m)))
    return folder


def declared_drive(
    path: Path,
    *,
    goal_m: float | None = DROVE_M,
    declared_after_s: float | None = 16.0,
    localised: bool = True,
    text: str = "Goal succeeded",
) -> Path:
    """Six metres straight on in 15 s and then at rest until 20 s; the supervisor declares when it is told to."""
    words, messages = RosMessageTypes(), []
    for index in range(200):
        at_s, x_m = START_S + 0.1 * index, min(0.04 * index, DROVE_M)
        sample = Odometry(
            seq=1, at_s=at_s, source="odometry", frame="map", x_m=x_m, y_m=0.0, yaw_rad=0.0,
            v_mps=0.4 if x_m < DROVE_M else 0.0, w_radps=0.0,
        )  # fmt: skip
        messages.append(("/odom", ODOMETRY, at_s, words.odometry(sample)))
        if localised:
            messages.append(("/vbot_planner/body_pose", POSE, at_s, words.pose(pose_at(at_s, x_m))))
    if goal_m is not None:
        messages.append(("/goal_pose", POSE, START_S + 0.5, words.pose(pose_at(START_S + 0.5, goal_m))))
    if declared_after_s is not None:
        at_s = START_S + declared_after_s
        messages.append(("/rosout", LOG, at_s, words.log(at_s, "bt_navigator", text)))
        messages.append(("/rosout", LOG, at_s + 0.1, words.log(at_s + 0.1, "controller", "Reached the goal!")))
    return mcap_of(path, sorted(messages, key=lambda one: one[2]))
