"""A recorded mission and what reading it back gives."""

import math

import numpy as np
import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.recording.disk_buffer import DiskBuffer
from harness.adapters.providers.recording.messages import COMPRESSED_IMAGE, PATH, POSE
from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes
from harness.adapters.providers.recording.topics import TopicSettings
from harness.adapters.providers.recording.writer import LIMIT_BYTES, record_mission
from harness.contracts.errors import RecordingInvalid
from harness.contracts.observations import Image, Odometry, Pose, Scan
from harness.verification.geometry import polyline_length
from tests.fixtures.recordings import BACK, OUT, START_S, mcap_of, noisy_frame, pose_at, walk
from tests.saying import raises_saying

BODY_POSE = "/vbot_planner/body_pose"


@pytest.fixture
def mission():
    return walk()


@pytest.fixture
def recorded(mission, tmp_path):
    path = tmp_path / "mission.mcap"
    record_mission(path, mission.mission, samples=mission.samples, blob=mission.blobs.__getitem__)
    with open_recording(path) as recording:
        yield recording


@pytest.mark.ledger("R176", symbol="harness.adapters.providers.recording.writer:_Recorder._events")
def test_a_mission_is_written_with_the_papers_topics_in_the_map_frame(recorded, mission):
    types = {topic.name: topic.type for topic in recorded.topics}
    assert types["/vbot_planner/body_pose"] == "geometry_msgs/msg/PoseStamped"
    assert types["/initial_path"] == types["/path"] == "nav_msgs/msg/Path"
    assert (recorded.frame, recorded.map_version) == ("map", "site-1")
    assert [route.route_m for route in recorded.paths()] == [OUT, BACK]
    assert {"/rosout", "/tf_static"} <= set(types)
    lasted_s = mission.samples[-1].at_s - mission.samples[0].at_s
    assert {topic.name: topic.messages for topic in recorded.topics}["/path"] == math.ceil(lasted_s / 10.0) == 4


def test_poses_and_odometry_come_back_sample_for_sample(recorded, mission):
    def figures(samples, kind):
        return [(round(s.at_s, 6), s.x_m, s.y_m, round(s.yaw_rad, 9)) for s in samples if isinstance(s, kind)]

    for kind in (Pose, Odometry):
        assert figures(recorded.samples(), kind) == figures(mission.samples, kind)
    assert [sample.seq for sample in recorded.samples()] == list(range(1, len(list(recorded.samples())) + 1))


@pytest.mark.ledger("R212", symbol="harness.adapters.providers.recording.segments:_Meter.segment")
def test_declared_measured_and_last_distances_are_three_figures_at_their_own_times(recorded):
    out, back = recorded.segments()
    assert (out.name, back.name) == ("outbound", "return")
    assert (out.reference_length_m, back.reference_length_m) == (7.0, 7.0)
    assert (out.declared_distance_m, back.declared_distance_m) == (0.13, 0.19)
    assert out.measured_distance_m == pytest.approx(0.11, abs=1e-6)
    assert back.last_pose_distance_m == pytest.approx(0.17, abs=1e-6)
    assert out.arrived_s < out.last_pose_s


def test_a_segment_keeps_the_first_distance_the_excursion_and_the_departure(recorded):
    out, _ = recorded.segments()
    assert out.first_pose_distance_m == pytest.approx(5.0)
    assert out.excursion_m == pytest.approx(5.0)
    assert out.departed_s == pytest.approx(START_S + 2.0)


def test_the_recorded_slam_path_is_the_walked_way(recorded):
    route = recorded.slam_path().route_m
    assert polyline_length(route) == pytest.approx(14.0, abs=0.5)
    assert math.dist(route[-1], BACK[-1]) < 0.3


@pytest.mark.parametrize("frame", ["map", "odom", "world", "map_01"])
@pytest.mark.ledger("R177", symbol="harness.adapters.providers.recording.survey:_poses_in")
def test_the_slam_path_is_the_final_one_that_is_not_empty(tmp_path, frame):
    words = RosMessageTypes()
    stages = [[(0.0, 0.0)], [(0.0, 0.0), (1.0, 0.0)], []]
    paths = [("/path", PATH, 10.0 + at, words.path(10.0 + at, frame, points)) for at, points in enumerate(stages)]
    pose = (BODY_POSE, POSE, 10.0, words.pose(pose_at(10.0, 0.0, frame=frame)))
    with open_recording(mcap_of(tmp_path / "slam.mcap", [pose, paths[1], paths[0], paths[2]])) as recording:
        assert recording.slam_path().route_m == ((0.0, 0.0), (1.0, 0.0))
        assert recording.slam_path().at_s == pytest.approx(11.0)


@pytest.mark.ledger("R178", symbol="harness.adapters.providers.recording.samples:RecordingClock.sensed_s")
def test_camera_times_are_log_times_even_where_their_stamps_say_otherwise(mission, tmp_path):
    words, jpeg = RosMessageTypes(), next(iter(_pictures(mission)))
    messages = [(BODY_POSE, POSE, 10.0 + 0.1 * at, words.pose(pose_at(10.0 + 0.1 * at, 0.0))) for at in range(20)]
    messages.append(("/cam", COMPRESSED_IMAGE, 11.0, words.image(555.0, "camera", jpeg, "jpeg")))
    path = mcap_of(tmp_path / "camera.mcap", messages)
    for clock, expected in (("log", 11.0), ("header", 555.0)):
        with open_recording(path, TopicSettings(camera_clock=clock)) as recording:
            (image,) = [sample for sample in recording.samples() if isinstance(sample, Image)]
            assert image.at_s == pytest.approx(expected, abs=1e-6)


@pytest.mark.ledger("R178", symbol="harness.adapters.providers.recording.segments:Segment.elapsed_s")
def test_zero_is_the_dispatch_of_the_reference_path(recorded):
    out, back = recorded.segments()
    assert out.elapsed_s(out.dispatched_s) == 0.0
    assert back.elapsed_s(back.arrived_s) == pytest.approx(13.9, abs=0.2)


@pytest.mark.ledger("R179", symbol="harness.adapters.providers.recording.samples:Samples._to_body")
def test_clouds_in_lidar_init_come_back_to_the_body_through_the_recorded_transform(mission, tmp_path):
    path = tmp_path / "mission.mcap"
    record_mission(path, mission.mission, samples=mission.samples, blob=mission.blobs.__getitem__)
    spill = DiskBuffer()
    with open_recording(path) as recording:
        scans = [sample for sample in recording.samples(spill.put) if isinstance(sample, Scan)]
        assert [transform.child for transform in recording.static_transforms()] == ["lidar_init"]
    original = next(sample for sample in mission.samples if isinstance(sample, Scan))
    wrote = np.frombuffer(mission.blobs[original.blob], dtype="<f4").reshape(-1, 3)
    read = np.frombuffer(spill.get(scans[0].blob), dtype="<f4").reshape(-1, 3)
    assert scans[0].frame == "body"
    np.testing.assert_allclose(read, wrote, atol=1e-5)


def test_a_cloud_without_a_transform_is_left_out_and_said_so(mission, tmp_path):
    path = tmp_path / "mission.mcap"
    record_mission(path, mission.mission, samples=mission.samples, blob=mission.blobs.__getitem__)
    with open_recording(path, TopicSettings(recorded_transforms="/none")) as recording:
        assert not [sample for sample in recording.samples() if isinstance(sample, Scan)]
        assert any("no transform joins “lidar_init”" in sentence(reason) for reason in recording.summary().left_out)


def test_a_mission_with_large_pictures_is_thinned_to_four_mebibytes_but_keeps_every_pose(tmp_path):
    heavy = walk(frames=8, noise=noisy_frame, points=20_000)
    assert sum(map(len, heavy.blobs.values())) > 2 * LIMIT_BYTES
    path = tmp_path / "mission.mcap"
    written = record_mission(path, heavy.mission, samples=heavy.samples, blob=heavy.blobs.__getitem__)
    assert path.stat().st_size == written.bytes <= LIMIT_BYTES
    poses = sum(isinstance(sample, Pose) for sample in heavy.samples)
    assert written.messages["/vbot_planner/body_pose"] == poses
    assert written.messages["/camera/image/compressed"] == 8


def test_a_mission_that_cannot_fit_is_refused_and_leaves_no_file(mission, tmp_path):
    path = tmp_path / "mission.mcap"
    with raises_saying(RecordingInvalid, match="does not fit into 1000 bytes"):
        record_mission(path, mission.mission, samples=mission.samples, blob=mission.blobs.__getitem__, limit_bytes=1000)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_refused(mission, tmp_path):
    with raises_saying(RecordingInvalid, match="cannot be written"):
        record_mission(
            tmp_path / "no" / "m.mcap", mission.mission, samples=mission.samples, blob=mission.blobs.__getitem__
        )


def test_a_mission_without_poses_is_refused(mission, tmp_path):
    with raises_saying(RecordingInvalid, match="no poses"):
        record_mission(tmp_path / "m.mcap", mission.mission, samples=(), blob=mission.blobs.__getitem__)


def test_a_given_target_makes_one_segment_over_everything(recorded):
    (whole,) = recorded.segments((3.0, 4.0))
    assert whole.target_source == "given target"
    assert whole.reference_length_m is None
    assert whole.last_pose_distance_m == pytest.approx(5.0, abs=0.2)


def test_a_route_dispatched_after_the_last_position_makes_no_segment(tmp_path):
    words = RosMessageTypes()
    messages = [(BODY_POSE, POSE, 10.0 + at, words.pose(pose_at(10.0 + at, float(at)))) for at in range(3)]
    messages.append(("/initial_path", PATH, 99.0, words.path(99.0, "map", list(OUT))))
    with open_recording(mcap_of(tmp_path / "late.mcap", messages)) as recording:
        (whole,) = recording.segments()
    assert whole.target_source == "no target"
    assert whole.target_m is whole.last_pose_distance_m is None
    assert whole.excursion_m == pytest.approx(2.0)


def test_a_route_sent_again_to_the_same_target_before_an_arrival_is_one_segment(tmp_path):
    words = RosMessageTypes()
    messages = [(BODY_POSE, POSE, 10.0 + at, words.pose(pose_at(10.0 + at, float(at)))) for at in range(9)]
    messages += [("/initial_path", PATH, at, words.path(at, "map", list(OUT))) for at in (10.0, 13.0)]
    messages.append(("/initial_path", PATH, 16.0, words.path(16.0, "map", list(BACK))))
    with open_recording(mcap_of(tmp_path / "retry.mcap", messages)) as recording:
        assert [(leg.name, leg.dispatched_s) for leg in recording.segments()] == [
            ("segment 1", 10.0),
            ("segment 2", 16.0),
        ]


def test_a_route_in_a_frame_that_nothing_joins_to_the_positions_is_refused(tmp_path):
    words = RosMessageTypes()
    messages = [(BODY_POSE, POSE, 10.0, words.pose(pose_at(10.0, 0.0)))]
    messages.append(("/initial_path", PATH, 10.0, words.path(10.0, "elsewhere", list(OUT))))
    with (
        open_recording(mcap_of(tmp_path / "frames.mcap", messages)) as recording,
        raises_saying(RecordingInvalid, match="stated in elsewhere, positions in map"),
    ):
        recording.paths()


def _pictures(mission):
    return [mission.blobs[sample.blob] for sample in mission.samples if isinstance(sample, Image)]
