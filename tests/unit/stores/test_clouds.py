"""Point cloud files: what is read is all there, in metres; what is not a cloud says so."""

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pypcd4.pypcd4 import PointCloud

from harness.adapters.cloud_headers import cloud_head
from harness.adapters.cloud_levels import LEVELS_M, chunks, origin_of
from harness.adapters.clouds import read_cloud
from harness.contracts.errors import CloudInvalid
from tests.saying import raises_saying

UTM = np.array([512_700.125, 5_403_547.25, 295.5])


LASZIP_RECORD = 54
"""Bytes of the head of a record of variable length in LAS."""


def scatter(count: int, *, reach_m: float = 8.0, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-reach_m, reach_m, size=(count, 3))


def pcd(folder: Path, points: np.ndarray) -> Path:
    file = folder / "cloud.pcd"
    PointCloud.from_xyz_points(points.astype(np.float32)).save(file)
    return file


def test_a_pcd_file_is_read_point_by_point_and_broken_points_are_counted(tmp_path: Path) -> None:
    points = scatter(500)
    points[7] = np.nan
    read, dropped = read_cloud(pcd(tmp_path, points))
    assert dropped == 1
    assert np.allclose(read, np.delete(points, 7, axis=0), atol=1e-5)


def test_millimetres_become_metres(tmp_path: Path) -> None:
    points = scatter(50) * 1000.0
    read, _ = read_cloud(pcd(tmp_path, points), metres_per_unit=0.001)
    assert np.allclose(read, points / 1000.0, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "body", "why"),
    [
        ("cloud.e57", b"ASTM-E57", "LAZ, not .e57"),
        ("cloud.las", b"LASF", "header"),
        ("cloud.laz", b"LASF" + bytes(371), "hold together"),
        ("cloud.pcd", b"", "hold together"),
        ("cloud.pcd", b"x,y,z\n1,2,3\n", "hold together"),
        ("cloud.ply", b"plx\n", "hold together"),
        ("cloud.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n", "hold"),
        ("cloud.pcd", b"VERSION 0.7\nPOINTS 99999999999\n", "larger than"),
        ("cloud.pcd", b"FIELDS x y z\nWIDTH 3\nHEIGHT 0\nPOINTS 3\nDATA ascii\n", "POINTS 3, WIDTH 3, HEIGHT 0"),
    ],
)
def test_what_is_no_cloud_says_what_and_where(tmp_path: Path, name: str, body: bytes, why: str) -> None:
    (tmp_path / name).write_bytes(body)
    with raises_saying(CloudInvalid, match=why) as caught:
        read_cloud(tmp_path / name)
    assert name in caught.value.where


def test_a_file_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    whole = pcd(tmp_path, scatter(500))
    whole.write_bytes(whole.read_bytes()[:-600])
    with pytest.raises(CloudInvalid):
        read_cloud(whole)


def las(file: Path, points: np.ndarray, *, version: str = "1.2") -> Path:
    """A LAS file in millimetre steps, compressed where its name ends in .laz."""
    header = laspy.LasHeader(point_format=6 if version == "1.4" else 1, version=version)
    header.scales, header.offsets = np.full(3, 0.001), np.floor(points.min(axis=0))
    written = laspy.LasData(header)
    written.x, written.y, written.z = points.T
    written.write(file)
    return file


@pytest.mark.parametrize(("name", "version"), [("a.las", "1.2"), ("a.laz", "1.2"), ("a.las", "1.4"), ("a.laz", "1.4")])
def test_las_and_laz_keep_coordinates_far_from_the_origin(tmp_path: Path, name: str, version: str) -> None:
    points = scatter(700) + UTM
    read, dropped = read_cloud(las(tmp_path / name, points, version=version))
    assert dropped == 0
    assert np.abs(read - points).max() <= 0.0005001


@pytest.mark.parametrize(
    ("at", "number", "why"),
    [(12, 0, "300 points, 0 in each"), (12, 2**31 - 1, "2147483647 in each"), (32, 0, "does not hold together")],
    ids=["chunks-without-points", "chunks-beyond-memory", "points-of-nothing"],
)
def test_a_laz_file_whose_record_would_end_its_unpacker_is_refused(
    tmp_path: Path, at: int, number: int, why: str
) -> None:
    file = las(tmp_path / "record.laz", scatter(300))
    body = bytearray(file.read_bytes())
    record = body.index(b"laszip encoded") - 2 + LASZIP_RECORD
    assert struct.unpack_from("<I", body, record + 12)[0] == 50_000, "the points of a chunk stand there"
    struct.pack_into("<I" if at == 12 else "<H", body, record + at, number)
    file.write_bytes(body)
    with raises_saying(CloudInvalid, match=why):
        read_cloud(file)


@pytest.mark.parametrize("name", ["cut.las", "cut.laz"])
def test_a_las_file_that_was_cut_off_is_refused(tmp_path: Path, name: str) -> None:
    whole = las(tmp_path / name, scatter(700))
    whole.write_bytes(whole.read_bytes()[:-600])
    with pytest.raises(CloudInvalid):
        read_cloud(whole)


@pytest.mark.parametrize("written_in_one_go", [False, True])
def test_a_laz_file_with_more_chunks_than_points_is_refused_before_it_is_read(
    tmp_path: Path, written_in_one_go: bool
) -> None:
    file = las(tmp_path / "chunks.laz", scatter(300))
    body = bytearray(file.read_bytes())
    first = struct.unpack_from("<I", body, 96)[0]
    table = struct.unpack_from("<q", body, first)[0]
    struct.pack_into("<I", body, table + 4, 2**31)
    if written_in_one_go:
        struct.pack_into("<q", body, first, -1)
        body += struct.pack("<q", table)
    file.write_bytes(body)
    with raises_saying(CloudInvalid, match="2147483648 chunks of 300 points"):
        cloud_head(file)


@pytest.mark.parametrize("packed", [False, True])
def test_the_header_of_a_las_file_is_held_to_the_size_of_the_file(tmp_path: Path, packed: bool) -> None:
    name = "lies.laz" if packed else "lies.las"
    body = bytearray(las(tmp_path / name, scatter(300)).read_bytes())
    struct.pack_into("<I", body, 107, 1_000_000_000 if not packed else 40_000_000)
    (tmp_path / name).write_bytes(body)
    with raises_saying(CloudInvalid, match="promises"):
        cloud_head(tmp_path / name)


@settings(max_examples=25, deadline=None)
@given(count=st.integers(1, 400), seed=st.integers(0, 50))
def test_every_point_is_in_one_chunk_and_levels_only_get_finer(count: int, seed: int) -> None:
    points = scatter(count, seed=seed) + UTM
    origin_m = origin_of(points)
    parts = list(chunks(points, origin_m))
    back = np.concatenate([part.points.astype(np.float64) for part in parts]) + np.asarray(origin_m)
    assert np.allclose(np.sort(back, axis=0), np.sort(points, axis=0), atol=1e-5)
    sizes = [part.voxel_m for part in parts]
    assert sizes == sorted(sizes, reverse=True)


def test_the_coarsest_level_alone_fills_every_voxel_that_the_cloud_fills() -> None:
    points = scatter(5000)
    first = next(iter(chunks(points, (0.0, 0.0, 0.0))))
    coarse = {tuple(cell) for cell in np.floor(first.points / LEVELS_M[0]).astype(int)}
    assert coarse == {tuple(cell) for cell in np.floor(points.astype(np.float32) / LEVELS_M[0]).astype(int)}
    assert len(first.points) == len(coarse)
