"""Pictures: the right size, the right geometry, and scenes that deserve their truth."""

import math

import cv2
import numpy as np
import pytest

from experiments.benchmarks.scenes import AISLE_X, AISLE_Y, random_scene
from harness.contracts.observations import Image, Odometry
from harness.contracts.values import Point
from simulator.camera import CAMERA, jpeg, render
from simulator.solids import SiteModel, Solid, standing
from tests.unit.simulation.builders import along, bench

RED = (0.9, 0.05, 0.05)


def red_pixels(site: SiteModel, pose: tuple[float, float, float]) -> np.ndarray:
    picture = render(site, pose).astype(int)
    return np.argwhere((picture[:, :, 0] > 60) & (picture[:, :, 1] < 40) & (picture[:, :, 2] < 40))


def in_aisle(point: Point) -> bool:
    return AISLE_X[0] < point[0] < AISLE_X[1] and AISLE_Y[0] < point[1] < AISLE_Y[1]


def only(solid: Solid) -> SiteModel:
    return SiteModel(name="one thing", frame="map", map_version="site-1", solids=(solid,))


def test_a_frame_is_1280_by_720_in_colour() -> None:
    box = standing("box", "box", (3.0, 0.0), (0.5, 0.5, 0.5), RED)
    assert render(only(box), (0.0, 0.0, 0.0)).shape == (720, 1280, 3)


@pytest.mark.parametrize("yaw", [0.0, 1.1, -2.5])
def test_a_box_appears_where_the_pinhole_model_puts_it(yaw: float) -> None:
    ahead, left, half = 3.0, 0.5, 0.2
    at = (ahead * math.cos(yaw) - left * math.sin(yaw), ahead * math.sin(yaw) + left * math.cos(yaw))
    box = standing("box", "box", at, (2 * half, 2 * half, 2 * half), RED)
    turned = Solid(name="b", kind="box", centre_m=box.centre_m, half_m=box.half_m, rgb=RED, yaw_rad=yaw)
    found = red_pixels(only(turned), (0.0, 0.0, yaw))
    forward = ahead - half - CAMERA.forward_m
    cos, sin = math.cos(CAMERA.pitch_rad), math.sin(CAMERA.pitch_rad)
    deep, down = cos * forward + sin * CAMERA.height_m, cos * CAMERA.height_m - sin * forward
    left_edge = CAMERA.cx_px - CAMERA.fx_px * (left + half) / deep
    foot = CAMERA.cy_px + CAMERA.fy_px * down / deep
    assert found[:, 1].min() == pytest.approx(left_edge, abs=8)
    assert found[:, 0].max() == pytest.approx(foot, abs=3)


def test_faces_turned_to_the_lamp_are_brighter() -> None:
    cube = standing("cube", "box", (3.0, 0.0), (1.0, 1.0, 1.0), (0.6, 0.6, 0.6))
    site = SiteModel(name="c", frame="map", map_version="site-1", solids=(cube,), lamps_m=((-3.0, 0.0, 2.0),))
    facing = render(site, (0.0, 0.0, 0.0))[360, 640].mean()
    away = render(site, (6.0, 0.0, math.pi))[360, 640].mean()
    assert facing > away + 30


def test_a_frame_survives_jpeg() -> None:
    picture = render(only(standing("box", "box", (3.0, 0.0), (0.5, 0.5, 0.5), RED)), (0.0, 0.0, 0.0))
    back = cv2.imdecode(np.frombuffer(jpeg(picture), dtype=np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    assert np.abs(back.astype(int) - picture.astype(int)).mean() < 3.0


def test_scenes_are_blocked_exactly_when_a_box_stands_inside_the_passage() -> None:
    scenes = [random_scene(seed) for seed in range(200)]
    assert 70 <= sum(scene.truth_blocked for scene in scenes) <= 130
    for scene in scenes:
        boxes = [solid for solid in scene.model.solids if solid.kind in ("box", "chair")]
        inside = [box for box in boxes if any(in_aisle(corner) for corner in box.corners())]
        assert tuple(inside) == scene.obstructions
        assert bool(inside) == scene.truth_blocked


def test_free_scenes_hold_paint_in_the_colours_of_boxes() -> None:
    marked = [random_scene(seed) for seed in range(60) if not random_scene(seed).truth_blocked]
    painted = [any(solid.name.startswith("mark-") for solid in scene.model.solids) for scene in marked]
    assert sum(painted) > len(marked) / 2


def test_the_same_seed_is_the_same_scene() -> None:
    assert random_scene(11) == random_scene(11)
    assert random_scene(11) != random_scene(12)


@pytest.mark.ledger("R200", symbol="simulator.photography:Panorama.step")
def test_a_panorama_is_eight_turns_eight_frames_and_the_first_heading_again() -> None:
    made = bench()
    before = made.pose().yaw_rad
    report = made.run("panorama-camera", {"frames": 8.0})
    assert report.status == "succeeded"
    assert [receipt.kind for receipt in report.receipts] == ["rotation", "capture"] * 8
    images = [sample for sample in made.samples("camera") if isinstance(sample, Image)]
    assert [image.blob for image in images] == list(report.blobs)
    assert [image.seq for image in images] == list(report.samples)
    turns = np.diff([before, *(image.yaw_rad for image in images)])
    assert np.remainder(turns, math.tau) == pytest.approx([math.tau / 8] * 8, abs=0.03)
    assert math.remainder(made.pose().yaw_rad - before, math.tau) == pytest.approx(0.0, abs=0.03)
    body = np.frombuffer(made.robot.blob(images[0].blob), dtype=np.uint8)
    assert cv2.imdecode(body, cv2.IMREAD_COLOR).shape == (720, 1280, 3)


def test_every_capture_has_noise_of_its_own_that_a_second_run_repeats() -> None:
    first, again = bench(), bench()
    looks = [made.run("observer", {"duration_s": 1.0, "frames": 1.0}, node=node)
             for made in (first, again) for node in ("one", "two")]  # fmt: skip
    one, two, repeated_one, repeated_two = (look.blobs[0] for look in looks)
    assert one != two
    assert (one, two) == (repeated_one, repeated_two)


def test_every_frame_is_taken_standing_for_a_second() -> None:
    made = bench()
    made.run("panorama-camera", {"frames": 3.0})
    for image in made.samples("camera"):
        second = [sample for sample in made.samples("odometry") if image.at_s - 1.0 <= sample.at_s <= image.at_s]
        assert max(abs(sample.w_radps) for sample in second if isinstance(sample, Odometry)) < 0.02


def test_an_observer_moves_nothing() -> None:
    made = bench()
    before = made.pose()
    report = made.run("observer", {"duration_s": 2.0, "frames": 1.0})
    assert report.status == "succeeded"
    assert len(report.blobs) == 1
    assert (made.pose().x_m, made.pose().yaw_rad) == (before.x_m, before.yaw_rad)
    assert [start.moves for start in made.robot.starts()] == [False]
    assert made.run("route-follower", along("A-B"), node="next").status == "succeeded"
