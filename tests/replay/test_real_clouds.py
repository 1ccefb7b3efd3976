"""Real clouds of five makers are read whole; real malformed ones are refused."""

from pathlib import Path

import pytest

from harness.adapters.clouds import read_cloud
from harness.contracts.errors import CloudInvalid


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "count", "dropped"),
    [
        ("room_scan1.pcd", 112_586, 0),
        ("capture0001.pcd", 249_647, 57_553),
        ("samp11-utm.pcd", 38_010, 0),
        ("target.ply", 69_088, 0),
        ("OS-1-128_v2.3.0_1024x10_lb_n3_map-000.ply", 155_000, 0),
    ],
)
def test_real_clouds_are_read_whole(real_data: Path, name: str, count: int, dropped: int) -> None:
    points, left_out = read_cloud(real_data / "clouds" / name)
    assert (len(points), left_out) == (count, dropped)


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["missingheader.pcd", "utm17_comma.pcd", "no_vertex.ply", "unsized_dims.ply"])
def test_real_malformed_clouds_are_refused(real_data: Path, name: str) -> None:
    with pytest.raises(CloudInvalid):
        read_cloud(real_data / "malformed" / name)
