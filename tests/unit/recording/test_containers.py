"""Every readable container gives the same samples; every damaged one is refused with what, where and what to do."""

import sqlite3

import pytest
import zstandard
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as FolderWriter
from rosbags.typesys import Stores, get_typestore

from app.i18n.reasons.rendering import remedy, sentence
from harness.adapters.providers.recording.messages import LOG, ODOMETRY, POSE
from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes
from harness.adapters.providers.recording.topics import StaticTransform, TopicSettings
from harness.contracts.errors import RecordingInvalid
from harness.contracts.observations import Odometry, Pose
from harness.contracts.reasons import plain
from tests.fixtures.recordings import ROS1, START_S, mcap_of, odometry_mcap, pose_at, ros1_odometry
from tests.saying import raises_saying

MESSAGES = 200


def positions(path, **changes):
    with open_recording(path, **changes) as recording:
        return [(round(sample.at_s - START_S, 6), sample.x_m) for sample in recording.samples() if sample.source]


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    return positions(odometry_mcap(tmp_path_factory.mktemp("plain") / "plain.mcap"))


@pytest.mark.parametrize(
    "changes",
    [
        {"compression": CompressionType.LZ4},
        {"compression": CompressionType.NONE},
        {"chunked": False},
        {"type": "nav_msgs/Odometry"},
        {"body": lambda body: zstandard.compress(body)},
        {"order": reversed},
        {"order": lambda span: sorted(span, key=lambda index: index % 7)},
        {"definition": ""},
    ],
    ids=[
        "lz4",
        "unpacked",
        "unchunked",
        "ros1-style-name",
        "packed-messages",
        "backwards",
        "shuffled",
        "no-definition",
    ],
)
def test_an_mcap_gives_the_same_samples_however_it_was_written(tmp_path, expected, changes):
    assert positions(odometry_mcap(tmp_path / "one.mcap", **changes)) == expected


def test_a_file_packed_as_a_whole_gives_the_same_samples(tmp_path, expected):
    plain = odometry_mcap(tmp_path / "plain.mcap")
    packed = tmp_path / "packed.mcap.zstd"
    packed.write_bytes(zstandard.compress(plain.read_bytes()))
    assert positions(packed) == expected


@pytest.mark.parametrize("packing", [None, BagWriter.CompressionFormat.BZ2, BagWriter.CompressionFormat.LZ4])
def test_a_ros1_bag_gives_the_same_samples(tmp_path, expected, packing):
    assert positions(_bag(tmp_path / "one.bag", packing)) == expected


@pytest.mark.parametrize(
    ("storage", "mode"),
    [
        (StoragePlugin.MCAP, None),
        (StoragePlugin.SQLITE3, None),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    ],
)
def test_a_rosbag2_folder_gives_the_same_samples(tmp_path, expected, storage, mode):
    assert positions(_folder(tmp_path / "folder", storage, mode)) == expected


def test_the_file_of_a_folder_can_be_opened_by_itself(tmp_path, expected):
    folder = _folder(tmp_path / "folder", StoragePlugin.SQLITE3, None)
    assert positions(folder / "folder.db3") == expected


def test_odometry_alone_speaks_as_pose_and_odometry_of_one_source(tmp_path):
    with open_recording(odometry_mcap(tmp_path / "one.mcap")) as recording:
        pose, odometry = list(recording.samples())[:2]
        assert isinstance(pose, Pose)
        assert isinstance(odometry, Odometry)
        assert pose.source == odometry.source == "odometry"
        assert recording.summary().single_source


def test_a_foreign_recording_is_a_map_of_its_own(tmp_path):
    with open_recording(odometry_mcap(tmp_path / "one.mcap")) as recording:
        assert recording.frame == "odom"
        assert recording.map_version == f"recording:{recording.sha256}"


def test_a_static_transform_of_the_settings_takes_positions_to_the_map(tmp_path):
    turned = StaticTransform(parent="map", child="odom", translation_m=(10.0, 0.0, 0.0), rotation=(0.0, 0.0, 1.0, 1.0))
    with open_recording(odometry_mcap(tmp_path / "one.mcap"), TopicSettings(static_transforms=(turned,))) as recording:
        last = [sample for sample in recording.samples() if isinstance(sample, Pose)][-1]
        assert recording.frame == last.frame == "map"
        assert (last.x_m, last.y_m) == pytest.approx((10.0, 9.95))
        assert last.yaw_rad == pytest.approx(1.5707963)


def test_simulated_stamps_make_mission_time_and_log_time_is_told_beside_it(tmp_path):
    path = odometry_mcap(tmp_path / "sim.mcap", stamp_offset_s=-START_S + 100.0)
    with open_recording(path) as recording:
        assert recording.clocks.clock == "header"
        assert recording.clocks.first_log_s == pytest.approx(START_S)
        assert next(recording.samples()).at_s == pytest.approx(100.0, abs=1e-5)
    with open_recording(path, TopicSettings(clock="log")) as recording:
        assert next(recording.samples()).at_s == pytest.approx(START_S)


def test_missing_stamps_fall_back_to_log_time_and_say_so(tmp_path):
    with open_recording(odometry_mcap(tmp_path / "bare.mcap", stamped=False)) as recording:
        assert recording.clocks.clock == "log"
        assert recording.clocks.reason is not None
        assert sentence(recording.clocks.reason) == "200 messages on /odom carry no header stamp"
        assert next(recording.samples()).at_s == pytest.approx(START_S)


def test_positions_that_are_not_finite_are_left_out_and_counted(tmp_path):
    path = odometry_mcap(tmp_path / "nan.mcap", x_m=lambda index: float("nan") if index == 3 else 1.0)
    with open_recording(path) as recording:
        assert len([sample for sample in recording.samples() if isinstance(sample, Pose)]) == MESSAGES - 1
        assert "/odom: 1 positions are not finite" in map(sentence, recording.summary().left_out)


def test_several_odometry_topics_must_be_chosen(tmp_path):
    path = odometry_mcap(tmp_path / "two.mcap", topics=("/wheel", "/visual"))
    with raises_saying(RecordingInvalid, match="name one of /visual, /wheel"):
        open_recording(path)
    with open_recording(path, TopicSettings(odometry="/wheel")) as recording:
        assert recording.roles.position == "/wheel"


def test_a_topic_that_is_not_there_or_of_another_type_is_refused(tmp_path):
    path = odometry_mcap(tmp_path / "one.mcap")
    with raises_saying(RecordingInvalid, match=r"/other is not in the recording.*/odom \(nav_msgs"):
        open_recording(path, TopicSettings(odometry="/other"))
    with raises_saying(RecordingInvalid, match="camera topic /odom has the type nav_msgs/msg/Odometry"):
        open_recording(path, TopicSettings(camera="/odom"))


def test_the_supervisors_lines_are_declarations_with_their_distance(tmp_path):
    words = RosMessageTypes()
    lines = ("planner: replan", "[supervisor] GOAL REACHED, distance 0.11 m", "GOAL REACHED")
    messages = [("/vbot_planner/body_pose", POSE, 10.0, words.pose(pose_at(10.0, 0.0)))]
    messages += [("/rosout", LOG, 11.0 + at, words.log(11.0 + at, "supervisor", line)) for at, line in enumerate(lines)]
    with open_recording(mcap_of(tmp_path / "log.mcap", messages)) as recording:
        told = [(line.kind, line.at_s, line.distance_m) for line in recording.declarations()]
    assert told == [("arrival", 12.0, 0.11), ("arrival", 13.0, None)]


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 0.999])
def test_a_truncated_mcap_is_refused_and_recovered_only_on_request(tmp_path, share):
    whole = odometry_mcap(tmp_path / "whole.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(len(whole) * share)])
    with raises_saying(RecordingInvalid, match="truncated"):
        open_recording(cut)
    if share > 0.3:
        with open_recording(cut, recover=True) as recording:
            found = len([sample for sample in recording.samples() if isinstance(sample, Pose)])
            assert 0 < found <= MESSAGES
            assert f"{found} messages" in sentence(recording.summary().incomplete or "")


def test_every_flipped_byte_is_refused_or_changes_nothing(tmp_path, expected):
    whole = odometry_mcap(tmp_path / "whole.mcap").read_bytes()
    flipped = tmp_path / "flipped.mcap"
    refused = 0
    for at in range(0, len(whole), 97):
        flipped.write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        try:
            assert positions(flipped) == expected, f"byte {at} changed the samples silently"
        except RecordingInvalid:
            refused += 1
    assert refused > 100


def test_a_file_without_checksums_says_that_only_its_structure_was_checked(tmp_path):
    path = odometry_mcap(tmp_path / "bare.mcap", crcs=False, compression=CompressionType.NONE)
    with open_recording(path) as recording:
        assert sentence(recording.summary().checks).startswith("structure only")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
def test_a_truncated_bag_is_refused_and_recovered_only_on_request(tmp_path, share):
    whole = _bag(tmp_path / "whole.bag", None).read_bytes()
    cut = tmp_path / "cut.bag"
    cut.write_bytes(whole[: int(len(whole) * share)])
    with raises_saying(RecordingInvalid, match="truncated"):
        open_recording(cut)


def test_a_truncated_packed_file_is_refused(tmp_path):
    whole = zstandard.compress(odometry_mcap(tmp_path / "plain.mcap").read_bytes())
    cut = tmp_path / "cut.mcap.zstd"
    cut.write_bytes(whole[: len(whole) // 2])
    with raises_saying(RecordingInvalid, match=r"truncated|damaged"):
        open_recording(cut)


def test_a_folder_that_lacks_messages_its_metadata_declares_is_refused(tmp_path):
    folder = _folder(tmp_path / "folder", StoragePlugin.SQLITE3, None)
    database = sqlite3.connect(folder / "folder.db3")
    database.execute("DELETE FROM messages WHERE id > 150")
    database.commit()
    database.close()
    with raises_saying(RecordingInvalid, match="declares 200 messages; its files hold 150"):
        open_recording(folder)


def test_a_database_with_an_unmerged_log_beside_it_is_refused(tmp_path):
    folder = _folder(tmp_path / "folder", StoragePlugin.SQLITE3, None)
    (folder / "folder.db3-wal").write_bytes(b"messages")
    with raises_saying(RecordingInvalid, match="was not closed"):
        open_recording(folder)


def test_a_missing_split_is_named(tmp_path):
    folder = _folder(tmp_path / "folder", StoragePlugin.MCAP, None)
    (folder / "folder.mcap").unlink()
    with raises_saying(RecordingInvalid, match=r"lacks 1: folder\.mcap"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"encoding": "json"}, "encoded as “json”"),
        ({"type": "acme_msgs/msg/Where", "definition": ""}, r"/odom \(acme_msgs/msg/Where, 200\)"),
        ({"definition": "this is no definition ("}, "definition of nav_msgs/msg/Odometry on topic /odom cannot"),
        ({"body": lambda body: body[:40]}, "on /odom cannot be decoded"),
        ({"messages": 0}, "holds no messages"),
        ({"x_m": lambda index: float("inf")}, "None of the 200 positions on /odom is finite"),
    ],
    ids=["encoding", "unknown-type", "bad-definition", "short-bodies", "empty", "all-infinite"],
)
def test_what_cannot_be_used_is_refused(tmp_path, changes, said):
    with raises_saying(RecordingInvalid, match=said) as refusal:
        open_recording(odometry_mcap(tmp_path / "bad.mcap", **changes))
    assert refusal.value.do or remedy(refusal.value)
    assert "bad.mcap" in plain(refusal.value.where)


def test_what_is_no_recording_is_refused(tmp_path):
    for name, body, said in (("a.mcap", b"", "empty"), ("b.mcap", b"hello world", "not a recording")):
        (tmp_path / name).write_bytes(body)
        with raises_saying(RecordingInvalid, match=said):
            open_recording(tmp_path / name)
    with raises_saying(RecordingInvalid, match=r"no metadata\.yaml"):
        open_recording(tmp_path)
    with raises_saying(RecordingInvalid, match="no such recording"):
        open_recording(tmp_path / "absent.mcap")


def test_unpacked_copies_are_removed_on_close(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    packed = tmp_path / "packed.mcap.zstd"
    packed.write_bytes(zstandard.compress(odometry_mcap(tmp_path / "plain.mcap").read_bytes()))
    with open_recording(packed):
        assert list(tmp_path.glob("regen-recording-*"))
    assert not list(tmp_path.glob("regen-recording-*"))


def _bag(path, packing):
    writer = BagWriter(path)
    if packing:
        writer.set_compression(packing)
    with writer:
        connection = writer.add_connection("/odom", ODOMETRY, typestore=ROS1)
        for index in range(MESSAGES):
            at_s = START_S + 0.05 * index
            writer.write(connection, round(at_s * 1e9), ros1_odometry(0.05 * index, at_s))
    return path


def _folder(path, storage, mode):
    store = get_typestore(Stores.ROS2_JAZZY)
    plain = odometry_mcap(path.parent / "plain.mcap")
    writer = FolderWriter(path, version=9, storage_plugin=storage)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with open_recording(plain) as recording, writer:
        connection = writer.add_connection("/odom", ODOMETRY, typestore=store)
        words = RosMessageTypes()
        for sample in recording.samples():
            if isinstance(sample, Odometry):
                writer.write(connection, round(sample.at_s * 1e9), words.odometry(sample))
    plain.unlink()
    return path
