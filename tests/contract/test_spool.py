"""What every spool keeps: an invocation's samples in order, until they are sealed; half a line costs only itself."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.adapters.stores.memory import MemorySpool
from harness.adapters.stores.spool import FileSpool
from harness.contracts.errors import LogDamaged, StoreUnavailable, UnknownName
from harness.contracts.ids import InvocationId, RequestId, sha256
from harness.contracts.observations import AnySample, Battery, Image, Imu, Odometry, Pose, Scan
from harness.contracts.ports import Spool
from tests.saying import raises_saying
from tests.unit.stores.processes import kill, lines, running

FIRST, SECOND = InvocationId("inv_1"), InvocationId("inv_2")


def battery(seq: int) -> Battery:
    return Battery(seq=seq, at_s=seq / 10, source="battery", charge=0.5)


EVERY_KIND: list[AnySample] = [
    Pose(seq=1, at_s=0.1, source="localiser", frame="map", map_version="1", x_m=0.1, y_m=-2.5, yaw_rad=3.1),
    Odometry(seq=2, at_s=0.2, source="odometry", frame="odom", x_m=1 / 3, y_m=0.0, yaw_rad=0.0, v_mps=0.5, w_radps=0.0),
    Imu(seq=3, at_s=0.3, source="imu", ax_mps2=1e-9, ay_mps2=0.0, w_radps=-0.25),
    Scan(seq=4, at_s=0.4, source="lidar", frame="body", blob=sha256(b"scan"), points=360),
    Image(
        seq=5,
        at_s=0.5,
        source="camera",
        frame="camera",
        blob=sha256(b"image"),
        media_type="image/jpeg",
        width_px=1280,
        height_px=720,
        yaw_rad=0.785,
        request_id=RequestId("r"),
    ),
    battery(6),
]


@pytest.fixture(params=["memory", "files"])
def spool(request: pytest.FixtureRequest, tmp_path: Path) -> Spool:
    return MemorySpool() if request.param == "memory" else FileSpool(tmp_path / "spool")


def test_samples_of_every_kind_come_back_equal_and_in_order(spool: Spool) -> None:
    spool.add(FIRST, EVERY_KIND[:2])
    spool.add(FIRST, iter(EVERY_KIND[2:]))
    assert spool.samples(FIRST) == EVERY_KIND


def test_invocations_do_not_mix_and_are_dropped_alone(spool: Spool) -> None:
    spool.add(FIRST, [battery(1)])
    spool.add(SECOND, [battery(2)])
    spool.drop(FIRST)
    spool.drop(FIRST)
    assert spool.samples(FIRST) == []
    assert spool.samples(SECOND) == [battery(2)]
    spool.add(FIRST, [battery(3)])
    assert spool.samples(FIRST) == [battery(3)]


def test_adding_nothing_is_nothing(spool: Spool) -> None:
    spool.add(FIRST, [])
    assert spool.samples(FIRST) == []


def test_what_samples_returned_is_not_the_spool_itself(spool: Spool) -> None:
    spool.add(FIRST, [battery(1)])
    spool.samples(FIRST).clear()
    assert spool.samples(FIRST) == [battery(1)]


def test_another_spool_on_the_folder_goes_on_where_the_first_ended(tmp_path: Path) -> None:
    FileSpool(tmp_path).add(FIRST, [battery(1)])
    after_restart = FileSpool(tmp_path)
    after_restart.add(FIRST, [battery(2)])
    assert after_restart.samples(FIRST) == [battery(1), battery(2)]


@pytest.fixture(scope="module")
def torn_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("torn")


@settings(deadline=None)
@given(lost=st.integers(min_value=1, max_value=60))
def test_a_torn_last_line_costs_only_itself_wherever_it_was_torn(torn_folder: Path, lost: int) -> None:
    before = FileSpool(torn_folder)
    before.drop(FIRST)
    before.add(FIRST, [battery(1), battery(2)])
    path = torn_folder / "inv_1.jsonl"
    whole = path.read_bytes()
    last = whole[:-1].rindex(b"\n") + 1
    path.write_bytes(whole[: max(last, len(whole) - lost)])
    after_restart = FileSpool(torn_folder)
    assert after_restart.samples(FIRST) == [battery(1)]
    after_restart.add(FIRST, [battery(3)])
    assert after_restart.samples(FIRST) == [battery(1), battery(3)]


def test_a_killed_writer_loses_nothing_it_had_added(tmp_path: Path) -> None:
    with running("spool", str(tmp_path)) as child:
        added = int((lines(child, 500) + kill(child))[-1])
    found = FileSpool(tmp_path).samples(FIRST)
    assert len(found) in (added, added + 1)
    assert [sample.seq for sample in found] == list(range(len(found)))


@pytest.mark.parametrize("line", [b"{}\n", b'{"kind":"battery","seq":1}\n', b"\xff\xfe\n", b"null\n"])
def test_a_whole_line_that_is_no_sample_is_damage(tmp_path: Path, line: bytes) -> None:
    spool = FileSpool(tmp_path)
    spool.add(FIRST, [battery(1)])
    with (tmp_path / "inv_1.jsonl").open("ab") as file:
        file.write(line)
    with raises_saying(LogDamaged, match="inv_1"):
        spool.samples(FIRST)


@pytest.mark.parametrize("name", ["", "../inv_1", "a/b", "inv_1.jsonl", "x" * 101, "inv\n"])
def test_what_is_no_invocation_id_names_no_file(tmp_path: Path, name: str) -> None:
    spool = FileSpool(tmp_path / "spool")
    for use in (
        lambda: spool.add(InvocationId(name), [battery(1)]),
        lambda: spool.samples(InvocationId(name)),
        lambda: spool.drop(InvocationId(name)),
    ):
        with pytest.raises(UnknownName):
            use()
    assert [path.name for path in tmp_path.rglob("*")] == ["spool"]


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with raises_saying(StoreUnavailable, match=r"cannot be used.*file"):
        FileSpool(tmp_path / "file" / "spool")
