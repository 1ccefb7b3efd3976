"""Trajectory files and CARMEN logs: poses with their own stamps, in robot axes; what is none of them says why."""

import math
from pathlib import Path

import pytest

from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.topics import TopicSettings
from harness.contracts.errors import RecordingInvalid
from harness.contracts.observations import Odometry, Pose
from tests.saying import raises_saying

START_S = 1_403_636_580


def written(folder: Path, name: str, lines: list[str]) -> Path:
    (folder / name).write_text("".join(f"{line}\n" for line in lines))
    return folder / name


def tum(folder: Path) -> Path:
    """Ten seconds ahead at 0.5 m/s, turned to the left by a right angle."""
    half = math.sqrt(0.5)
    return written(
        folder,
        "drive.txt",
        ["# timestamp tx ty tz qx qy qz qw"]
        + [f"{START_S + at}.123456789 0 {at / 2} 0.3 0 0 {half} {half}" for at in range(11)],
    )


def euroc(folder: Path) -> Path:
    half = math.sqrt(0.5)
    return written(
        folder,
        "data.csv",
        ["#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w [], q_x [], q_y [], q_z [], v_x [m s^-1], v_y, v_z"]
        + [f"{START_S + at}123456789,0,{at / 2},0.3,{half},0,0,{half},0,0.5,0" for at in range(11)],
    )


def kitti(folder: Path) -> Path:
    """Ahead along a camera's z axis, and then turned to the left: about its y axis, which points down."""
    return written(
        folder,
        "00.txt",
        [f"1 0 0 0 0 1 0 0 0 0 1 {at / 2}" for at in range(10)] + ["0 0 -1 0 0 1 0 0 1 0 0 5"],
    )


def poses(path: Path, **settings: object) -> list[Pose]:
    with open_recording(path, TopicSettings.model_validate(settings)) as recording:
        return [one for one in recording.samples() if isinstance(one, Pose)]


@pytest.mark.parametrize("file", [tum, euroc])
def test_a_pose_keeps_its_stamp_to_the_nanosecond_and_its_heading(tmp_path: Path, file: object) -> None:
    found = poses(file(tmp_path))  # type: ignore[operator]
    assert len(found) == 11
    assert found[-1].at_s == pytest.approx(START_S + 10.123456789, abs=3e-7)
    assert (found[-1].x_m, found[-1].y_m) == pytest.approx((0.0, 5.0))
    assert found[-1].yaw_rad == pytest.approx(math.pi / 2)
    assert {one.source for one in found} == {"localiser"}
    assert found[0].map_version.startswith("recording:")


def test_kitti_poses_of_a_camera_become_those_of_a_robot(tmp_path: Path) -> None:
    found = poses(kitti(tmp_path), pose_period_s=0.1)
    assert [one.at_s for one in found[:2]] == pytest.approx([0.1, 0.2])
    assert (found[-1].x_m, found[-1].y_m) == pytest.approx((5.0, 0.0))
    assert found[0].yaw_rad == pytest.approx(0.0)
    assert found[-1].yaw_rad == pytest.approx(math.pi / 2)


def test_a_tum_file_in_camera_axes_is_turned_where_the_settings_say_so(tmp_path: Path) -> None:
    file = written(tmp_path, "slam.txt", [f"{START_S + at} 0 0 {at} 0 0 0 1" for at in range(3)])
    assert [one.x_m for one in poses(file)] == pytest.approx([0, 0, 0])
    assert [one.x_m for one in poses(file, pose_axes="camera")] == pytest.approx([0, 1, 2])


def test_kitti_poses_take_their_stamps_from_the_file_beside_them(tmp_path: Path) -> None:
    kitti(tmp_path)
    written(tmp_path, "times.txt", [f"{at * 0.103736:.6e}" for at in range(1, 12)])
    found = poses(tmp_path)
    assert found[-1].at_s == pytest.approx(11 * 0.103736)
    written(tmp_path, "times.txt", ["0.1", "0.2"])
    with raises_saying(RecordingInvalid, match="fewer lines"):
        poses(tmp_path)


def test_odometry_of_a_carmen_log_is_read_and_the_rest_is_counted(tmp_path: Path) -> None:
    lines = ["# a log", "PARAM robot_length 0.4 ipc1 host 0.0"]
    for at in range(5):
        lines += [
            f"ODOM {at}.0 0.0 0.0 1.0 0.1 0.0 {976052857 + at}.25 nohost {at}.5",
            f"FLASER 3 1.0 2.0 3.0 {at}.0 0 0 {at}.0 0 0 {976052857 + at}.30 nohost {at}.55",
        ]
    with open_recording(written(tmp_path, "intel.log", lines)) as recording:
        found = list(recording.samples())
        counts = {topic.name: topic.messages for topic in recording.topics}
        assert recording.summary().single_source
    moved = [one for one in found if isinstance(one, Odometry)]
    assert [one.x_m for one in moved] == [0, 1, 2, 3, 4]
    assert (moved[0].at_s, moved[0].v_mps, moved[0].w_radps) == (976052857.25, 1.0, 0.1)
    assert counts == {"/odom": 5, "/flaser": 5, "/param": 1}


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (["1 2 3 0 0 0 1"], "carry no stamps"),
        (["2 0 0 0 0 0 0 1", "1 0 0 0 0 0 0 1"], "line 2 is earlier"),
        (["1 0 0 0 0 0 0 1", "2 0 0 zero 0 0 0 1"], "Line 2 is none of a tum file"),
        (["1 0 0 0 0 0 0 1", "2 0 0"], "Line 2 is none of a tum file"),
        (["-1 0 0 0 0 0 0 1"], "Line 1 is none of a tum file"),
        (["9e99 0 0 0 0 0 0 1"], "Line 1 is none of a tum file"),
        (["1 nan 0 0 0 0 0 1", "2 inf 0 0 0 0 0 1"], "None of the 2 positions on trajectory is finite"),
        (["1 2 3"], "not a recording"),
        (["one, two"], "not a recording"),
        (["FLASER 1 2.0 0 0 0 0 0 0 1 h 1"], "encoded as 'carmen'"),
    ],
)
def test_what_is_no_trajectory_says_why(tmp_path: Path, lines: list[str], why: str) -> None:
    with raises_saying(RecordingInvalid, match=why):
        poses(written(tmp_path, "file.txt", lines))


def test_a_file_that_breaks_off_is_read_up_to_there_only_where_that_was_asked(tmp_path: Path) -> None:
    whole = tum(tmp_path)
    whole.write_text(whole.read_text()[:-20])
    with raises_saying(RecordingInvalid, match="truncated"):
        open_recording(whole)
    with open_recording(whole, recover=True) as recording:
        assert len([*recording.samples()]) == 10
        assert recording.summary().incomplete is not None


def test_a_line_without_an_end_costs_no_memory(tmp_path: Path) -> None:
    file = tmp_path / "endless.txt"
    with file.open("wb") as into:
        into.write(b"1 0 0 0 0 0 0 1\n")
        into.truncate(64 * 2**20)
    with raises_saying(RecordingInvalid, match=r"not a recording|longer than"):
        poses(file)
