"""Real clouds of five makers are read whole; real malformed ones are refused."""

from pathlib import Path

import pytest

from harness.adapters.clouds import read_cloud
from harness.contracts.errors import CloudInvalid
from tests.integration.runs import answer, regen
from tests.saying import raises_saying


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


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("las/simple.las", 1065),
        ("las/simple.copc.laz", 1065),
        ("las/autzen_trim.laz", 110_000),
        ("las/unregistered_extra_bytes.las", 4),
        ("malformed/gps-time-nan.las", 1),
    ],
)
def test_real_survey_clouds_are_read_whole(real_data: Path, name: str, count: int) -> None:
    points, left_out = read_cloud(real_data / name)
    assert (len(points), left_out) == (count, 0)


@pytest.mark.real_data
def test_a_real_survey_cloud_without_points_is_refused(real_data: Path) -> None:
    with raises_saying(CloudInvalid, match="holds no point"):
        read_cloud(real_data / "malformed" / "no-points.las")


@pytest.mark.real_data
def test_a_survey_in_feet_is_imported_in_metres(real_data: Path, tmp_path: Path) -> None:
    file, said = real_data / "las" / "autzen_trim.laz", ("--frame", "utm", "--metres-per-unit", "0.3048")
    done = regen("map", "import", file, "--map-version", "autzen", *said, "--data", tmp_path / "data", "--json")
    cloud = answer(done)
    assert (cloud["points"], cloud["dropped"], cloud["frame"]) == (110_000, 0, "utm")
    assert 190_000 < cloud["low_m"][0] < 195_000
    listed = answer(regen("map", "list", "--data", tmp_path / "data", "--json"))
    assert [one["source"] for one in listed["maps"]] == ["autzen_trim.laz"]
