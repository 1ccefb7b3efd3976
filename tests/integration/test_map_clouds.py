"""A map's cloud: attached through the gate, shown coarse first, and left out where its bytes are damaged."""

from pathlib import Path

import numpy as np
import pytest
import viser
from msgspec.structs import replace
from pypcd4.pypcd4 import PointCloud

from app.scene.drawing import Drawing
from app.scene.map_cloud import MapView
from harness.bootstrap import Harness, simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import Digest
from harness.contracts.maps import AttachCloud, MapCloud, map_stream
from harness.map_clouds import stored_cloud
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR
from tests.integration.runs import answer, regen

ADA = Actor(name="ada", role="operator")


def imported(harness: Harness, folder: Path, *, points: int = 60_000) -> MapCloud:
    scatter = np.random.default_rng(3).uniform((-9, -9, 0), (9, 9, 2), size=(points, 3))
    PointCloud.from_xyz_points(scatter.astype(np.float32)).save(folder / "hall.pcd")
    return stored_cloud(harness.runtime, folder / "hall.pcd", map_version="site-1", frame="map")


def attached(harness: Harness, cloud: MapCloud) -> object:
    return harness.runtime.decide([(map_stream("site-1"), AttachCloud(actor=ADA, cloud=cloud, reason="scan"))])


def test_a_cloud_is_attached_once_and_one_that_does_not_add_up_is_refused(tmp_path: Path) -> None:
    with simulated(HarnessSettings(), simulator=SIMULATOR, seed=1) as harness:
        cloud = imported(harness, tmp_path)
        assert isinstance(attached(harness, cloud), Accepted)
        assert attached(harness, cloud) == Accepted(())
        short = attached(harness, replace(cloud, chunks=cloud.chunks[:-1]))
        assert isinstance(short, Refused)
        assert short.rule == "chunks_incomplete"
        assert harness.runtime.fold(map_stream("site-1")).cloud == cloud


def test_a_view_shows_the_coarsest_level_first_and_then_all_of_it(tmp_path: Path) -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        with simulated(HarnessSettings(), simulator=SIMULATOR, seed=1) as harness:
            cloud = imported(harness, tmp_path)
            drawing, view = Drawing(server, origin_m=(0.0, 0.0)), MapView(harness.runtime, whole=False)
            view.draw(drawing, cloud)
            assert view.shown == cloud.chunks[0].points < cloud.points / 20
            view.draw(drawing, cloud)
            assert view.shown == cloud.points
            assert view.missing == 0
    finally:
        server.stop()


def test_a_chunk_whose_bytes_are_gone_is_left_out_and_counted(tmp_path: Path) -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        with simulated(HarnessSettings(), simulator=SIMULATOR, seed=1) as harness:
            cloud = imported(harness, tmp_path)
            gone = replace(cloud.chunks[0], blob=Digest("ab" * 32))
            view = MapView(harness.runtime, whole=True)
            view.draw(Drawing(server, origin_m=(0.0, 0.0)), replace(cloud, chunks=(gone, *cloud.chunks[1:])))
            assert view.missing == 1
            assert view.shown == cloud.points - cloud.chunks[0].points
    finally:
        server.stop()


def test_the_command_line_imports_a_cloud_and_lists_it(tmp_path: Path) -> None:
    PointCloud.from_xyz_points(np.eye(3, dtype=np.float32)).save(tmp_path / "three.pcd")
    data, said = ("--data", tmp_path / "data"), ("--frame", "map", "--metres-per-unit", "1")
    unsaid = regen("map", "import", tmp_path / "three.pcd", *data)
    assert unsaid.returncode == 2 and "does not say its frame" in unsaid.stderr
    unsaid = regen("map", "import", tmp_path / "three.pcd", "--frame", "map", *data)
    assert unsaid.returncode == 2 and "does not say its metres-per-unit" in unsaid.stderr
    done = regen("map", "import", tmp_path / "three.pcd", *said, *data, "--json")
    assert answer(done)["points"] == 3
    PointCloud.from_xyz_points(2 * np.eye(3, dtype=np.float32)).save(tmp_path / "other.pcd")
    kept = regen("map", "import", tmp_path / "other.pcd", *said, *data)
    assert kept.returncode == 2 and "is shown with three.pcd already" in kept.stderr
    assert answer(regen("map", "list", "--data", tmp_path / "data", "--json"))["maps"][0]["source"] == "three.pcd"
    assert regen("map", "import", tmp_path / "other.pcd", *said, *data, "--replace").returncode == 0
    assert answer(regen("map", "list", "--data", tmp_path / "data", "--json"))["maps"][0]["source"] == "other.pcd"
    assert regen("audit", "verify", "--data", tmp_path / "data").returncode == 0


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("nothing.pcd", "The point cloud cannot be read: No such file"),
        ("words.txt", "read as PCD, PLY, LAS or LAZ, not .txt"),
    ],
)
def test_the_command_line_says_what_is_wrong_with_a_file(tmp_path: Path, name: str, says: str) -> None:
    said = ("--frame", "map", "--metres-per-unit", "1")
    refused = regen("map", "import", tmp_path / name, *said, "--data", tmp_path / "data")
    assert refused.returncode == 1
    assert says in refused.stderr
