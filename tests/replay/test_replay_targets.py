"""A replay is judged by a target that somebody named, and never by where the recording happens to end (D38)."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest
from typer.testing import CliRunner

from app.cli.main import app
from app.i18n.reasons.rendering import explained
from harness.adapters.providers.recording.messages import ODOMETRY, POSE, POSE_COVARIANCE
from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.ros_message_types import RosMessageTypes
from harness.contracts.errors import HarnessError
from harness.contracts.observations import Odometry
from tests.fixtures.recordings import START_S, amcl_pose, mcap_of, pose_at

CARRIED = Path(__file__).resolve().parents[1] / "fixtures" / "warehouse-inspection.mcap"
DROVE_M = 6.0


def regen(*words: str) -> tuple[int, dict[str, Any], str]:
    """Exit code, JSON and what was said; the program exits 2 for a typed error, which reaches us as it was raised."""
    done = CliRunner().invoke(app, [*words, "--json"])
    found = json.loads(done.stdout) if done.stdout.startswith("{") else {}
    if isinstance(done.exception, HarnessError):
        return 2, found, explained(done.exception)
    return done.exit_code, found, done.output


def replay(path: Path, data: Path, *words: str) -> tuple[int, dict[str, Any], str]:
    return regen("mission", "replay", str(path), "--data", str(data), *words)


def drive(path: Path, *, goals: tuple[tuple[float, float, float], ...] = (), topic: str = "/goal_pose") -> Path:
    """Six metres straight on and then 4 s at rest, by odometry alone; goals as (seconds, x_m, y_m)."""
    words, messages = RosMessageTypes(), []
    for index in range(200):
        at_s = START_S + 0.1 * index
        sample = Odometry(
            seq=1, at_s=at_s, source="odometry", frame="odom", x_m=min(0.04 * index, DROVE_M), y_m=0.0,
            yaw_rad=0.0, v_mps=0.4 if 0.04 * index < DROVE_M else 0.0, w_radps=0.0,
        )  # fmt: skip
        messages.append(("/odom", ODOMETRY, at_s, words.odometry(sample)))
    for after_s, x_m, y_m in goals:
        at_s = START_S + after_s
        messages.append((topic, POSE, at_s, words.pose(pose_at(at_s, x_m, y_m, frame="odom"))))
    return mcap_of(path, sorted(messages, key=lambda one: one[2]))


def sparsely_localised(
    path: Path, *, silent_from_m: float = math.inf, jumps_at_m: float = math.inf, carried: Path | None = None
) -> Path:
    """The same drive, or a real one, with a localiser like AMCL beside the odometry: an update every quarter of a metre
    driven, none at rest. It may fall silent on the way, or contradict odometry by a metre from somewhere on.
    """
    words, messages = RosMessageTypes(), []
    driven_m, updated_m, before = 0.0, -1.0, None
    for at_s, x_m, y_m, yaw_rad, v_mps in real_odometry(carried) if carried else straight_on():
        driven_m += math.dist(before, (x_m, y_m)) if before else 0.0
        before = (x_m, y_m)
        sample = Odometry(
            seq=1, at_s=at_s, source="odometry", frame="odom", x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, v_mps=v_mps,
            w_radps=0.0,
        )  # fmt: skip
        messages.append(("/odom", ODOMETRY, at_s, words.odometry(sample)))
        if driven_m - updated_m >= 0.25 and driven_m < silent_from_m:
            updated_m = driven_m
            off_m = 1.0 if driven_m >= jumps_at_m else 0.02 * math.sin(9 * driven_m)
            body = amcl_pose(pose_at(at_s, x_m, y_m + off_m, yaw_rad=yaw_rad))
            messages.append(("/amcl_pose", POSE_COVARIANCE, at_s + 0.02, body))
    return mcap_of(path, sorted(messages, key=lambda one: one[2]))


def straight_on() -> Iterator[tuple[float, float, float, float, float]]:
    """Of the drive above: seconds, x_m, y_m, yaw_rad, v_mps."""
    for index in range(200):
        yield START_S + 0.1 * index, min(0.04 * index, DROVE_M), 0.0, 0.0, 0.4 if 0.04 * index < DROVE_M else 0.0


def real_odometry(path: Path) -> Iterator[tuple[float, float, float, float, float]]:
    """The odometry of a recorded drive."""
    with open_recording(path) as recording:
        for sample in recording.samples():
            if isinstance(sample, Odometry):
                yield sample.at_s, sample.x_m, sample.y_m, sample.yaw_rad, sample.v_mps


AMCL = ("--topic", "body_pose=/amcl_pose")


def test_a_sparse_localiser_beside_odometry_is_not_worse_than_odometry_alone(tmp_path: Path) -> None:
    target = ("--target", f"{DROVE_M},0")
    path = sparsely_localised(tmp_path / "nav2.mcap")
    alone, _, _ = replay(path, tmp_path / "alone", *target)
    code, found, _ = replay(path, tmp_path / "both", *target, *AMCL)
    assert (alone, code, found["status"]) == (0, 0, "succeeded")
    (result,) = [
        one for one in the_verdict(tmp_path / "both", found["mission_id"])["results"] if "distance_m" in one["measured"]
    ]
    assert result["measured"]["last_pose_distance_m"] < 0.1
    assert result["sources"] == ["odometry"], "at rest nothing but odometry speaks, and the verdict says so"


@pytest.mark.parametrize("wrong", [{"silent_from_m": 4.0}, {"jumps_at_m": 5.5}], ids=["silent", "contradicting"])
def test_a_sparse_localiser_that_falls_silent_in_motion_or_contradicts_odometry_leaves_the_arrival_open(
    wrong: dict[str, float], tmp_path: Path
) -> None:
    path = sparsely_localised(tmp_path / "nav2.mcap", **wrong)
    code, found, _ = replay(path, tmp_path / "data", "--target", f"{DROVE_M},0", *AMCL)
    assert (code, found["status"]) == (1, "failed")


def the_verdict(data: Path, mission_id: str) -> dict[str, Any]:
    _, found, _ = regen("mission", "events", mission_id, "--data", str(data))
    (verdict,) = [one["body"]["verdict"] for one in found["events"] if one["kind"] == "VerdictRecorded"]
    return dict(verdict)


def test_without_a_target_the_arrival_is_ambiguous_and_the_drive_is_still_measured(tmp_path: Path) -> None:
    code, found, _ = replay(drive(tmp_path / "drive.mcap"), tmp_path / "data")
    assert (code, found["status"], found["target_source"], found["target_m"]) == (1, "failed", "no target", None)
    assert found["path_length_m"] == pytest.approx(DROVE_M, abs=0.1)
    assert found["duration_s"] == pytest.approx(19.9, abs=0.1)
    (segment,) = found["segments"]
    assert segment["measured_distance_m"] is segment["last_pose_distance_m"] is None
    verdict = the_verdict(tmp_path / "data", found["mission_id"])
    assert verdict["verdict"] == "ambiguous"
    assert verdict["results"][0]["reason"]["code"] == "no_target"
    assert verdict["results"][0]["measured"]["path_length_m"] == pytest.approx(DROVE_M, abs=0.4)


@pytest.mark.parametrize(("x_m", "code"), [(DROVE_M, 0), (DROVE_M + 2.0, 1)])
def test_the_recorded_goal_is_the_target(tmp_path: Path, x_m: float, code: int) -> None:
    path = drive(tmp_path / "drive.mcap", goals=((0.0, x_m, 0.0),))
    exit_code, found, _ = replay(path, tmp_path / "data")
    assert (exit_code, found["target_source"]) == (code, "recorded goal")
    (segment,) = found["segments"]
    assert segment["last_pose_distance_m"] == pytest.approx(x_m - DROVE_M, abs=0.05)
    assert found["single_source"] == "/odom"
    _, shown, _ = regen("mission", "show", found["mission_id"], "--data", str(tmp_path / "data"))
    assert shown["labels"]["single_source"] == "/odom"


def test_a_replay_says_on_the_terminal_that_nothing_else_confirms_its_one_source(tmp_path: Path) -> None:
    path = drive(tmp_path / "drive.mcap", goals=((0.0, DROVE_M, 0.0),))
    done = CliRunner().invoke(app, ["mission", "replay", str(path), "--data", str(tmp_path / "data")])
    assert "Single source: position and motion come from /odom; nothing else confirms them." in done.output


def test_each_recorded_goal_is_a_leg_of_its_own(tmp_path: Path) -> None:
    path = drive(tmp_path / "drive.mcap", goals=((0.0, 2.0, 0.0), (6.0, DROVE_M, 0.0)))
    code, found, _ = replay(path, tmp_path / "data")
    assert [one["name"] for one in found["segments"]] == ["segment 1", "segment 2"]
    assert code == 1, "the robot drove through its first goal and did not stop there"


def test_the_goal_may_come_over_a_topic_that_is_named(tmp_path: Path) -> None:
    path = drive(tmp_path / "drive.mcap", goals=((0.0, DROVE_M, 0.0),), topic="/my/goal")
    assert replay(path, tmp_path / "one")[1]["target_source"] == "no target"
    code, found, _ = replay(path, tmp_path / "two", "--topic", "goal=/my/goal")
    assert (code, found["target_source"]) == (0, "recorded goal")


@pytest.mark.parametrize(("target", "code"), [("6.0,0.0", 0), ("0.0,0.0", 1)])
def test_a_target_from_the_command_line_is_measured(tmp_path: Path, target: str, code: int) -> None:
    path = drive(tmp_path / "drive.mcap", goals=((0.0, 40.0, 40.0),))
    exit_code, found, _ = replay(path, tmp_path / "data", "--target", target)
    assert (exit_code, found["target_source"]) == (code, "--target")


@pytest.mark.parametrize(("place", "code"), [("home", 0), ("storage area", 1)])
def test_a_place_is_a_target_on_the_map_of_its_site_and_images_are_decoded_in_a_process_of_their_own(
    tmp_path: Path, place: str, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def decode(*_: object) -> None:
        raise AssertionError("a foreign image was decoded in this process")

    monkeypatch.setattr(cv2, "imdecode", decode)
    exit_code, found, _ = replay(CARRIED, tmp_path / "data", "--place", place)
    assert (exit_code, found["target_source"], found["left_out"]) == (code, f"--place {place}", [])


def test_a_place_on_another_map_an_unknown_place_and_two_targets_are_refused(tmp_path: Path) -> None:
    path = drive(tmp_path / "drive.mcap")
    code, _, said = replay(path, tmp_path / "data", "--place", "home")
    assert code == 2
    assert "--topic map_version=" in said
    code, _, said = replay(CARRIED, tmp_path / "data", "--place", "the moon")
    assert code == 2
    assert "moon" in said
    assert replay(path, tmp_path / "data", "--place", "home", "--target", "1,2")[0] == 2
    assert replay(path, tmp_path / "data", "--target", "nan,0")[0] == 2


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["derived/husky_test1.mcap", "bags/test1.bag", "bags/test2.bag"])
def test_a_real_drive_without_a_goal_is_not_called_an_arrival(real_data: Path, name: str, tmp_path: Path) -> None:
    code, found, _ = replay(real_data / name, tmp_path / "data")
    assert (code, found["status"], found["target_source"]) == (1, "failed", "no target")
    assert found["path_length_m"] > 1.0
    assert the_verdict(tmp_path / "data", found["mission_id"])["results"][0]["reason"]["code"] == "no_target"


@pytest.mark.real_data
def test_a_real_drive_is_measured_at_the_target_that_is_given(real_data: Path, tmp_path: Path) -> None:
    code, found, _ = replay(real_data / "derived/husky_test1.mcap", tmp_path / "data", "--target", "1000,1000")
    assert (code, found["target_source"]) == (1, "--target")
    (segment,) = found["segments"]
    assert segment["measured_distance_m"] > 500.0


@pytest.mark.real_data
def test_a_sparse_localiser_beside_a_real_drive_s_odometry_is_not_worse(real_data: Path, tmp_path: Path) -> None:
    source = real_data / "derived/husky_test1.mcap"
    *_, (_, x_m, y_m, _, _) = real_odometry(source)
    path = sparsely_localised(tmp_path / "nav2.mcap", carried=source)
    target = ("--target", f"{x_m:.3f},{y_m:.3f}")
    alone, _, _ = replay(path, tmp_path / "alone", *target)
    both, _, _ = replay(path, tmp_path / "both", *target, *AMCL)
    assert (alone, both) == (0, 0)


def test_what_is_whole_of_a_cut_recording_is_replayed_on_request_and_labelled(tmp_path: Path) -> None:
    whole = drive(tmp_path / "whole.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 9 // 10])
    code, _, said = replay(cut, tmp_path / "data", "--target", "3,0")
    assert code == 2 and "truncated" in said and "--recover" in said
    _, found, _ = replay(cut, tmp_path / "data", "--target", "3,0", "--recover")
    assert found["incomplete_code"] == "recording_incomplete" and "truncated" in found["incomplete"]
    shown = regen("mission", "events", found["mission_id"], "--data", str(tmp_path / "data"))[1]
    (created,) = [one["body"] for one in shown["events"] if one["kind"] == "MissionCreated"]
    assert created["labels"]["incomplete"] == "yes"
    _, found, _ = replay(tmp_path / "whole.mcap", tmp_path / "data", "--target", "3,0")
    assert found["incomplete"] is None and found["checks"] == "checksum of every block verified"
