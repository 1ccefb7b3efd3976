"""The passage analysis: standing things are found by their shape, and nothing else is, whatever its colour."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.adapters.providers.models.passage import Report, analyse
from harness.adapters.providers.models.projection import View
from tests.unit.observations.painter import BLUE, CAMERA, CARDBOARD, PASSAGE, Rgb, Room

AHEAD = (0.0, math.pi / 4)


def report_on(room: Room, headings: tuple[float, ...] = AHEAD) -> Report:
    return analyse(room.frames(headings), camera=CAMERA, position=(0.0, 0.0), passage=PASSAGE)


def test_an_empty_passage_is_clear() -> None:
    report = report_on(Room())
    assert (report.blocked, report.findings, report.cited) == (False, (), ())
    assert report.in_view > 0.95
    assert report.text.startswith("The passage is clear")


@pytest.mark.parametrize("rgb", [CARDBOARD, BLUE])
def test_a_box_is_found_where_it_stands_and_as_large_as_it_is(rgb: Rgb) -> None:
    report = report_on(Room().box((2.6, 0.1), (0.4, 0.5, 0.45), rgb))
    (finding,) = report.findings
    assert report.blocked
    assert finding.floor_point_m == pytest.approx((2.4, 0.1), abs=0.1)
    assert finding.width_m == pytest.approx(0.5, abs=0.06)
    assert finding.height_m == pytest.approx(0.45, abs=0.06)
    assert finding.share_of_passage == pytest.approx(0.5 / 1.4, abs=0.05)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("height_m", [0.25, 0.5, 0.9])
def test_boxes_of_all_heights_and_turns_are_found(yaw_rad: float, height_m: float) -> None:
    report = report_on(Room().box((2.5, -0.2), (0.4, 0.4, height_m), CARDBOARD, yaw_rad=yaw_rad))
    assert len(report.findings) == 1


@pytest.mark.parametrize("yaw_rad", [0.0, 0.4, 0.785, 1.2])
@pytest.mark.parametrize("rgb", [CARDBOARD, BLUE, (40, 40, 44)])
def test_paint_on_the_floor_is_no_obstruction_whatever_its_colour(rgb: Rgb, yaw_rad: float) -> None:
    room = Room().paint((2.3, 0.1), (0.6, 0.5), rgb, yaw_rad=yaw_rad).paint((3.0, -0.4), (0.3, 0.3), rgb)
    assert report_on(room).findings == ()


def test_a_poster_in_the_boxes_colour_is_no_obstruction() -> None:
    assert report_on(Room().poster(0.0, 0.9, (0.8, 0.6), CARDBOARD).poster(0.5, 0.4, (0.4, 0.4), BLUE)).findings == ()


@pytest.mark.parametrize("at", [(2.5, 1.15), (2.5, -1.15), (4.2, 0.0), (1.1, 0.7)])
def test_a_box_that_stands_beside_the_passage_does_not_obstruct_it(at: tuple[float, float]) -> None:
    assert report_on(Room().box(at, (0.4, 0.4, 0.5), CARDBOARD)).findings == ()


def test_a_box_on_paint_of_its_own_colour_is_found() -> None:
    room = Room().paint((2.4, 0.0), (0.9, 0.8), CARDBOARD).box((2.5, 0.0), (0.4, 0.4, 0.5), CARDBOARD)
    assert report_on(room).blocked


def test_one_box_in_two_frames_is_one_finding_cited_where_it_shows_best() -> None:
    room = Room().box((2.3, 0.0), (0.4, 0.4, 0.5), BLUE)
    frames = room.frames((0.5, 0.1, -0.4))
    report = analyse(frames, camera=CAMERA, position=(0.0, 0.0), passage=PASSAGE)
    assert len(report.findings) == 1
    assert report.frames == tuple(frame.digest for frame in frames)
    assert set(report.cited) <= set(report.frames)
    assert len(report.cited) == 1


def test_two_boxes_apart_are_two_findings_widest_first() -> None:
    room = Room().box((2.2, 0.4), (0.3, 0.3, 0.4), BLUE).box((2.4, -0.3), (0.3, 0.5, 0.4), CARDBOARD)
    report = report_on(room)
    assert len(report.findings) == 2
    assert report.findings[0].share_of_passage > report.findings[1].share_of_passage


def test_frames_that_look_away_see_none_of_the_passage() -> None:
    report = report_on(Room().box((2.5, 0.0), (0.4, 0.4, 0.5), BLUE), headings=(math.pi,))
    assert (report.in_view, report.frames_with_passage, report.findings) == (0.0, 0, ())


def test_the_same_frames_give_the_same_report() -> None:
    room = Room().box((2.5, 0.2), (0.4, 0.4, 0.5), BLUE).paint((2.0, -0.3), (0.3, 0.3), BLUE)
    assert report_on(room) == report_on(room)


@given(x=st.floats(1.0, 8.0), y=st.floats(-3.0, 3.0), heading=st.floats(-0.4, 0.4), pitch=st.floats(-0.1, 0.3))
def test_a_floor_point_projects_to_a_pixel_and_back(x: float, y: float, heading: float, pitch: float) -> None:
    camera = type(CAMERA)(**{**{name: getattr(CAMERA, name) for name in CAMERA.__struct_fields__}, "pitch_rad": pitch})
    view = View(camera, position=(0.1, -0.2), heading_rad=heading)
    floor = np.array([[x, y]])
    if view.depth(floor)[0] > 0.3:
        assert view.floor(view.pixels(np.array([[x, y, 0.0]])))[0] == pytest.approx((x, y), abs=1e-6)


def test_a_pixel_above_the_horizon_has_no_floor() -> None:
    view = View(CAMERA, position=(0.0, 0.0), heading_rad=0.0)
    assert np.isnan(view.floor(np.array([[640.0, 10.0]]))).all()
    assert np.isnan(view.pixels(np.array([[-3.0, 0.0, 0.0]]))).all()
