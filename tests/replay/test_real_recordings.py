"""Real drives and real broken files: what the reader makes of recordings that nobody made for it."""

import time

import pytest

from app.i18n.reasons.rendering import remedy, sentence
from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.robot import RecordedRobot
from harness.contracts.errors import RecordingInvalid
from harness.contracts.observations import Odometry, Pose
from harness.contracts.reasons import plain
from harness.verification.geometry import path_length
from tests.saying import raises_saying

pytestmark = pytest.mark.real_data
HUSKY = ("derived/husky_test1.mcap", "bags/test1.bag")


@pytest.mark.parametrize("name", HUSKY)
def test_the_husky_drove_358_8_metres_in_395_seconds(real_data, name):
    with open_recording(real_data / name) as recording:
        assert path_length(point for _, point in recording.track()) == pytest.approx(358.8, rel=0.005)
        assert recording.duration_s == pytest.approx(395.3, abs=0.1)
        summary = recording.summary()
    counts = {topic.name: topic.messages for topic in summary.topics}
    assert counts == {"/husky_velocity_controller/odom": 3952, "/imu/data": 11865, "/fix": 989}
    assert summary.single_source
    assert summary.clocks.clock == "header"
    assert 0 < summary.clocks.least_delay_s < summary.clocks.most_delay_s < 0.001


def test_the_figure_does_not_hang_on_the_dead_band(real_data):
    with open_recording(real_data / HUSKY[0]) as recording:
        points = [point for _, point in recording.track()]
    lengths = [path_length(points, dead_band_m=band) for band in (0.0, 0.01, 0.02, 0.05, 0.1)]
    assert max(lengths) - min(lengths) < 0.05


def test_the_bag_and_the_mcap_made_of_it_give_the_same_samples(real_data):
    def figures(name):
        with open_recording(real_data / name) as recording:
            return [(s.at_s, s.x_m, s.y_m, s.yaw_rad) for s in recording.samples() if isinstance(s, Pose)]

    assert figures(HUSKY[0]) == figures(HUSKY[1])


@pytest.mark.parametrize("name", HUSKY)
def test_a_replay_runs_at_least_fifty_times_faster_than_the_drive(real_data, name):
    assert any(speed_of_a_replay(real_data / name) > 50 for _ in range(3))


def speed_of_a_replay(path):
    """Seconds of the drive in one second of this thread; other threads and processes do not count."""
    begun = time.thread_time()
    with open_recording(path) as recording:
        replay = RecordedRobot(recording)
        after = seen = 0
        while replay.now().mission_s < recording.ends_s:
            replay.advance_to(replay.now().mission_s + 0.5)
            page = replay.observations(after)
            after, seen = page.next_seq, seen + len(page.samples)
        drive_s = recording.duration_s
        replay.close()
    assert seen == 2 * 3952
    return drive_s / (time.thread_time() - begun)


def test_a_simulated_clock_is_mission_time(real_data):
    with open_recording(real_data / "bags/test2.bag") as recording:
        samples = list(recording.samples())
    assert samples[0].at_s == pytest.approx(47.584)
    assert sum(isinstance(sample, Odometry) for sample in samples) == 3060


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("edge_bags/wrong_rmw_test", "encoded as 'wrong_format'"),
        ("edge_bags/wrong_rmw_test/wrong_rmw_test_0.mcap", "encoded as 'wrong_format'"),
        ("edge_bags/empty_bag", "holds no messages"),
        ("edge_bags/only_services.mcap", "service calls only"),
        ("edge_bags/amber_soccer", r"names 13 files and lacks 12: soccer_goal_0\.mcap"),
        ("edge_bags/amber_soccer/soccer_goal_12.mcap", r"/camera/image_raw \(sensor_msgs/msg/Image, 2\)"),
        ("edge_bags/wbag", r"AAA \(std_msgs/msg/String, 804\)"),
        ("edge_bags/talker_db3", r"/rosout cannot be decoded"),
        ("edge_bags/cdr_test", r"/test_topic \(test_msgs/msg/BasicTypes, 3\)"),
        ("edge_bags/test_bag_for_seek", r"topic1 \(test_msgs/msg/BasicTypes, 5\)"),
        ("bags/cm_moving_obstacle", r"/local_costmap/costmap \(nav2_msgs/msg/Costmap, 231\)"),
        ("bags/cm_moving_obstacle/_tmp_cm_bag_0.mcap.zstd", r"/cmd_vel_smoothed \(geometry_msgs/msg/Twist, 231\)"),
        ("bags/512x10_raw.bag", r"/os_node0/lidar_packets \(ouster_ros/msg/PacketMsg, 32\)"),
        ("malformed/broken.png", "not a recording"),
        ("malformed", r"no metadata\.yaml"),
    ],
)
def test_what_cannot_be_replayed_is_refused_with_what_where_and_what_to_do(real_data, name, said):
    with raises_saying(RecordingInvalid, match=said) as refusal:
        open_recording(real_data / name)
    assert name in plain(refusal.value.where)
    assert refusal.value.do or remedy(refusal.value)


@pytest.mark.parametrize("name", HUSKY)
@pytest.mark.parametrize("share", [0.3, 0.5, 0.99])
def test_half_a_drive_is_never_presented_as_whole(real_data, tmp_path, name, share):
    whole = (real_data / name).read_bytes()
    cut = tmp_path / f"cut.{name[-4:]}"
    cut.write_bytes(whole[: int(len(whole) * share)])
    with raises_saying(RecordingInvalid, match="truncated"):
        open_recording(cut)
    with open_recording(cut, recover=True) as recording:
        assert "truncated" in sentence(recording.summary().incomplete or "")


def test_a_flipped_bit_in_a_block_is_found(real_data, tmp_path):
    body = bytearray((real_data / HUSKY[0]).read_bytes())
    body[len(body) // 2] ^= 1
    bad = tmp_path / "flipped.mcap"
    bad.write_bytes(bytes(body))
    with raises_saying(RecordingInvalid, match="damaged"):
        open_recording(bad)


@pytest.mark.parametrize(("name", "length_m"), [("groundtruth", 7.64), ("estimated", 8.06)])
def test_a_real_trajectory_file_is_replayed_with_its_stamps(real_data, name, length_m):
    with open_recording(real_data / "trajectory" / f"{name}.txt") as recording:
        found = [one for one in recording.samples() if isinstance(one, Pose)]
        assert path_length(point for _, point in recording.track()) == pytest.approx(length_m, abs=0.01)
        assert recording.duration_s == pytest.approx(21.27, abs=0.01)
    assert len(found) == 612 if name == "groundtruth" else len(found) > 500
    assert found[0].at_s == pytest.approx(1305031526.672, abs=0.001)
