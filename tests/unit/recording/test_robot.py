"""A recording as a robot: time, samples, the navigator's end, and nothing that moves."""

import subprocess
import sys

import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.recording import robot
from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.robot import RecordedRobot
from harness.adapters.providers.recording.writer import record_mission
from harness.contracts.errors import BlobDamaged, ProviderFailed
from harness.contracts.ids import Digest, MissionId, NodeId, ProviderId, RequestId
from harness.contracts.observations import Image, Pose, Scan
from harness.contracts.protocol import InvocationIdentity, StartRequest
from tests.fixtures.recordings import START_S, odometry_mcap, walk
from tests.saying import raises_saying

A_KEPT_SAMPLE_BYTES = 550


@pytest.fixture
def recording(tmp_path):
    mission = walk()
    path = tmp_path / "mission.mcap"
    record_mission(path, mission.mission, samples=mission.samples, blob=mission.blobs.__getitem__)
    with open_recording(path) as opened:
        yield opened


@pytest.fixture
def replay(recording):
    replay = RecordedRobot(recording)
    yield replay
    replay.close()


def request(name="1", **changes):
    identity = InvocationIdentity(
        mission_id=MissionId("mis"),
        node_id=NodeId("drive"),
        attempt=0,
        request_id=RequestId(name),
        provider_id=ProviderId("recording-navigator"),
    )
    fields = {
        "identity": identity,
        "capability": "navigate",
        "parameters": {"target": (3.0, 4.0), "frame": "map"},
        "k_ctx": 0,
        "configuration": Digest("c"),
        "deadline_s": START_S + 1000.0,
        "fencing": {},
    }
    return StartRequest(**(fields | changes))


def test_samples_appear_when_they_arrived_and_not_before(replay):
    assert replay.now().mission_s == START_S
    replay.advance_to(START_S + 5.0)
    shown = replay.observations(0)
    assert shown.at_s == START_S + 5.0
    assert max(sample.at_s for sample in shown.samples) <= START_S + 5.0
    assert [sample.seq for sample in shown.samples] == list(range(1, len(shown.samples) + 1))
    assert replay.observations(shown.next_seq).samples == ()
    replay.advance_to(START_S + 6.0)
    assert replay.observations(shown.next_seq).samples[0].seq == shown.next_seq + 1


def test_time_does_not_run_backwards(replay):
    replay.advance_to(START_S + 5.0)
    assert replay.advance_to(START_S + 1.0) == START_S + 5.0


def test_paging_by_any_limit_gives_every_sample_once(replay, recording):
    replay.advance_to(START_S + 100.0)
    seen, after = [], 0
    while page := replay.observations(after, limit=37).samples:
        seen += page
        after = page[-1].seq
    assert seen == list(recording.samples())


def test_samples_that_left_the_memory_are_read_from_the_file_again(recording):
    replay = RecordedRobot(recording, remembered=50)
    replay.advance_to(START_S + 100.0)
    again = replay.observations(3, limit=10).samples
    assert [sample.seq for sample in again] == list(range(4, 14))
    replay.close()


def test_images_and_scans_can_be_fetched_by_their_digest(replay):
    replay.advance_to(START_S + 100.0)
    bulk = [sample for sample in replay.observations(0).samples if isinstance(sample, Image | Scan)]
    assert {type(sample) for sample in bulk} == {Image, Scan}
    for sample in bulk:
        assert len(replay.blob(sample.blob)) > 100
    with raises_saying(BlobDamaged, match="has not shown"):
        replay.blob(Digest("0" * 64))


def test_the_navigator_moves_nothing_and_ends_with_its_segment(replay):
    (navigator,) = replay.providers()
    assert not navigator.card.moves
    started = navigator.start(request())
    assert started.status == "accepted"
    replay.advance_to(START_S + 10.0)
    assert navigator.report(started.handle).status == "running"
    assert 0.3 < navigator.report(started.handle).progress.share < 0.9
    out, back = replay.segments
    replay.advance_to(out.arrived_s + robot.SETTLE_S)
    ended = navigator.report(started.handle)
    assert ended.status == "succeeded"
    assert ended.declared["distance_m"] == 0.13
    assert ended.receipts[0].text == "GOAL REACHED, 0.13 m, as the recorded supervisor declared"
    second = navigator.start(request("2"))
    replay.advance_to(back.last_pose_s)
    assert navigator.report(second.handle).declared["distance_m"] == 0.19
    assert [start.moves for start in replay.starts()] == [False, False]


def test_a_recording_without_a_supervisor_declares_nothing(tmp_path):
    with open_recording(odometry_mcap(tmp_path / "one.mcap")) as recording:
        replay = RecordedRobot(recording)
        (navigator,) = replay.providers()
        started = navigator.start(request())
        replay.advance_to(recording.ends_s)
        ended = navigator.report(started.handle)
        assert (ended.status, ended.declared, ended.receipts) == ("succeeded", {}, ())
        assert "declares nothing" in sentence(ended.message)
        replay.close()


def test_a_repeated_request_starts_once_and_a_changed_one_is_refused(replay):
    (navigator,) = replay.providers()
    assert navigator.start(request()).handle == navigator.start(request()).handle
    assert len(replay.starts()) == 1
    with raises_saying(ProviderFailed, match="came again with other contents"):
        navigator.start(request(parameters={"target": (0.0, 0.0), "frame": "map"}))


def test_a_start_after_the_last_segment_is_refused(replay):
    replay.advance_to(START_S + 1000.0)
    with raises_saying(ProviderFailed, match="No recorded segment is left"):
        replay.providers()[0].start(request())


def test_a_stop_is_acknowledged_at_once(replay):
    (navigator,) = replay.providers()
    started = navigator.start(request())
    assert navigator.stop(started.handle).status == "cancelled"


def test_the_status_says_moving_standing_and_localised_from_the_recording(replay):
    replay.advance_to(START_S + 5.0)
    assert (replay.status().posture, replay.status().localised) == ("moving", True)
    replay.advance_to(replay.segments[0].last_pose_s - 0.1)
    assert replay.status().posture == "standing"
    replay.advance_to(START_S + 1000.0)
    assert not replay.status().localised


def test_memory_does_not_grow_with_the_length_of_the_file(tmp_path):
    lengths = (200, 1000, 5000)
    files = [odometry_mcap(tmp_path / f"{messages}.mcap", messages, chunk_size=16_384) for messages in lengths]
    program = [sys.executable, "-m", "tests.builders.replay_memory", *map(str, files)]
    told = subprocess.run(program, capture_output=True, text=True, timeout=200, check=True).stdout.splitlines()
    seen, peaks = zip(*(map(int, line.split()) for line in told), strict=True)
    assert seen == tuple(2 * messages for messages in lengths)
    assert (peaks[2] - peaks[1]) / (lengths[2] - lengths[1]) < A_KEPT_SAMPLE_BYTES / 4


def test_a_pose_is_bound_to_the_map_of_the_recording(tmp_path):
    with open_recording(odometry_mcap(tmp_path / "one.mcap")) as recording:
        replay = RecordedRobot(recording)
        pose = next(sample for sample in replay.observations(0).samples if isinstance(sample, Pose))
        assert pose.map_version == replay.status().map_version == f"recording:{recording.sha256}"
        replay.close()
