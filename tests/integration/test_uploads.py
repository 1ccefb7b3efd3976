"""Recordings and clouds come in pieces; a replay is a job that ends as a mission; every refusal is typed."""

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from pypcd4.pypcd4 import PointCloud

from app.background.uploads import Uploads
from app.views.uploaded_files import CHUNK_BYTES
from harness.contracts.errors import ContractInvalid
from tests.builders.consoles import Stand, console_stand
from tests.builders.declared_drives import declared_drive, rosbag2_drive
from tests.saying import raises_saying

OCTETS = {"content-type": "application/octet-stream"}


@pytest.fixture
def stand(tmp_path: Path) -> Iterator[Stand]:
    (tmp_path / "data").mkdir()
    with console_stand(folder=tmp_path / "data") as made:
        yield made


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def uploaded(client: TestClient, file: Path) -> dict[str, Any]:
    begun = client.post("/api/v1/uploads", json={"name": file.name, "size_bytes": file.stat().st_size})
    assert begun.status_code == 201, begun.text
    found, body = begun.json(), file.read_bytes()
    for at in range(0, len(body), 20_000):
        piece = body[at : at + 20_000]
        answer = client.post(f"/api/v1/uploads/{found['upload_id']}?offset={at}", content=piece, headers=OCTETS)
        assert answer.status_code == 200, answer.text
        found = answer.json()
    assert found["received_bytes"] == found["size_bytes"] == len(body)
    return found


def cloud(folder: Path) -> Path:
    points = np.random.default_rng(3).uniform((-9, -9, 0), (9, 9, 2), size=(2000, 3))
    PointCloud.from_xyz_points(points.astype(np.float32)).save(folder / "hall.pcd")
    return folder / "hall.pcd"


@pytest.mark.parametrize(("target_x_m", "status"), [(6.0, "succeeded"), (9.0, "failed")])
def test_an_uploaded_recording_is_replayed_as_a_mission(
    stand: Stand, operator: TestClient, tmp_path: Path, target_x_m: float, status: str
) -> None:
    sent = uploaded(operator, declared_drive(tmp_path / "drive.mcap"))
    target = {"target_x_m": target_x_m, "target_y_m": 0.0}
    asked = operator.post(f"/api/v1/uploads/{sent['upload_id']}/replay", json=target)
    assert (asked.status_code, asked.json()["state"]) == (202, "waiting")
    assert operator.delete(f"/api/v1/uploads/{sent['upload_id']}").json()["code"] == "contract_invalid"
    stand.app.state.console.replays.step()
    job = operator.get(f"/api/v1/replays/{asked.json()['replay_id']}").json()
    assert (job["state"], job["status"]) == ("ended", status)
    mission = operator.get(f"/api/v1/missions/{job['mission_id']}").json()
    assert mission["status"] == status
    assert operator.get(f"/missions/{job['mission_id']}").status_code == 200
    assert job["mission_id"] in operator.get("/recordings").text
    assert stand.harness.runtime.mission(job["mission_id"]).requested_by.name == "operator"
    operator.delete(f"/api/v1/uploads/{sent['upload_id']}")
    assert operator.get("/api/v1/uploads").json() == []


def test_a_replay_leaves_what_the_running_harness_does_alone(
    stand: Stand, operator: TestClient, tmp_path: Path
) -> None:
    driving = stand.driving()
    sent = uploaded(operator, declared_drive(tmp_path / "drive.mcap"))
    operator.post(f"/api/v1/uploads/{sent['upload_id']}/replay", json={})
    stand.app.state.console.replays.step()
    assert stand.harness.supervisor.run(driving).status == "succeeded"
    assert len(stand.harness.runtime.missions()) == 2


def test_a_file_that_is_no_recording_says_why_and_no_mission_begins(
    stand: Stand, operator: TestClient, tmp_path: Path
) -> None:
    (tmp_path / "broken.mcap").write_bytes(b"nothing of the kind")
    sent = uploaded(operator, tmp_path / "broken.mcap")
    asked = operator.post(f"/api/v1/uploads/{sent['upload_id']}/replay", json={}).json()
    stand.app.state.console.replays.step()
    job = operator.get(f"/api/v1/replays/{asked['replay_id']}").json()
    assert (job["state"], job["problem_code"], job["mission_id"]) == ("refused", "not_a_recording", "")
    assert "This is not a recording" in operator.get("/recordings").text
    assert stand.harness.runtime.missions() == []


def test_a_replay_that_waits_is_cancelled_and_never_begins(stand: Stand, operator: TestClient, tmp_path: Path) -> None:
    sent = uploaded(operator, declared_drive(tmp_path / "drive.mcap"))
    asked = operator.post(f"/api/v1/uploads/{sent['upload_id']}/replay", json={}).json()
    assert operator.delete(f"/api/v1/replays/{asked['replay_id']}").json()["state"] == "cancelled"
    stand.app.state.console.replays.step()
    assert stand.harness.runtime.missions() == []


def test_an_uploaded_cloud_is_attached_with_the_frame_and_unit_that_somebody_said(
    stand: Stand, operator: TestClient, tmp_path: Path
) -> None:
    sent = uploaded(operator, cloud(tmp_path))
    said = {"map_version": "site-1", "frame": "map", "metres_per_unit": 0.001, "reason": "scan"}
    unsaid = operator.post(f"/api/v1/uploads/{sent['upload_id']}/cloud", json={"map_version": "site-1"})
    assert unsaid.status_code == 422
    found = operator.post(f"/api/v1/uploads/{sent['upload_id']}/cloud", json=said).json()
    assert (found["points"], found["frame"], found["source"]) == (2000, "map", "hall.pcd")
    assert max(found["high_m"]) < 0.01
    (tmp_path / "other").mkdir()
    points = np.eye(3, dtype=np.float32)
    PointCloud.from_xyz_points(points).save(tmp_path / "other" / "three.pcd")
    other = uploaded(operator, tmp_path / "other" / "three.pcd")
    kept = operator.post(f"/api/v1/uploads/{other['upload_id']}/cloud", json=said)
    assert (kept.status_code, kept.json()["rule"]) == (409, "map_has_cloud")
    wrong = operator.post(f"/api/v1/uploads/{other['upload_id']}/replay", json={})
    assert wrong.status_code == 422


def test_the_forms_of_the_page_do_the_same_without_scripts(stand: Stand, operator: TestClient, tmp_path: Path) -> None:
    drive = declared_drive(tmp_path / "drive.mcap")
    posted = operator.post("/recordings", files={"file": ("drive.mcap", drive.read_bytes())})
    assert posted.status_code == 303
    (sent,) = operator.get("/api/v1/uploads").json()
    form = {"target_x_m": "6", "target_y_m": "0", "place": "", "topics": "map_frame=map\n"}
    assert operator.post(f"/recordings/{sent['upload_id']}/replay", data=form).status_code == 303
    stand.app.state.console.replays.step()
    assert [one["status"] for one in operator.get("/api/v1/replays").json()] == ["succeeded"]
    half = operator.post(f"/recordings/{sent['upload_id']}/replay", data={"target_x_m": "6"})
    assert half.status_code == 422 and "one of the two" in half.text
    strange = operator.post("/recordings", files={"file": ("virus.exe", b"MZ")})
    assert strange.status_code == 422 and ".exe are not taken" in strange.text
    assert operator.post(f"/recordings/{sent['upload_id']}/remove").status_code == 303
    assert operator.get("/api/v1/uploads").json() == []


def test_whoever_may_only_read_uploads_nothing(stand: Stand) -> None:
    answer = stand.stranger().post("/api/v1/uploads", json={"name": "a.mcap", "size_bytes": 10})
    assert answer.status_code == 401


def store(folder: Path, *, most_bytes: int = 10**6) -> Uploads:
    names = iter(f"upload-{number:020d}" for number in range(100))
    return Uploads(folder, most_bytes=most_bytes, clock=lambda: 1000.0, fresh=lambda: next(names))


def test_pieces_are_taken_in_order_once_and_never_beyond_the_end(tmp_path: Path) -> None:
    uploads = store(tmp_path)
    one = uploads.begin("../../etc/drive.mcap", size_bytes=8, by="ada")
    assert one.name == "drive.mcap"
    uploads.add(one.upload_id, offset=0, piece=b"abcd", by="ada")
    assert uploads.add(one.upload_id, offset=0, piece=b"abcd", by="ada").received_bytes == 4
    for offset, piece in ((5, b"x"), (4, b"too much")):
        with raises_saying(ContractInvalid, match="due at byte 4"):
            uploads.add(one.upload_id, offset=offset, piece=piece, by="ada")
    with raises_saying(ContractInvalid, match="4 of 8 bytes are here"):
        uploads.whole(one.upload_id)
    uploads.add(one.upload_id, offset=4, piece=b"efgh", by="ada")
    assert store(tmp_path).path(store(tmp_path).whole(one.upload_id)).read_bytes() == b"abcdefgh"


@pytest.mark.parametrize(
    ("name", "size", "why"),
    [("a.mcap", 10**7, "the limit is 1000000"), ("a.mcap", 0, "is not taken"), ("a.sh", 10, "not taken")],
)
def test_what_is_not_taken_says_why(tmp_path: Path, name: str, size: int, why: str) -> None:
    with raises_saying(ContractInvalid, match=why):
        store(tmp_path).begin(name, size_bytes=size, by="ada")


def test_one_piece_fits_into_one_request() -> None:
    assert CHUNK_BYTES < 1024 * 1024


def floor_map(folder: Path, *, resolution: float = 0.5, image: str = "hall.pgm") -> tuple[Path, Path]:
    """A map_server map around the places of the shipped site: walls at its edge, free floor inside."""
    cells = np.full((120, 160), 254, np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 0
    drawn, described = folder / "hall.pgm", folder / "hall.yaml"
    drawn.write_bytes(b"P5\n160 120\n255\n" + cells.tobytes())
    described.write_text(
        f"image: {image}\nresolution: {resolution}\norigin: [-40.0, -30.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return described, drawn


def sent_together(client: TestClient, *files: Path) -> Any:
    """Several files as one, as the page's script sends them; the answer to the last piece."""
    body = b"".join(one.read_bytes() for one in files)
    parts = [{"name": one.name, "size_bytes": one.stat().st_size} for one in files]
    begun = client.post("/api/v1/uploads", json={"name": files[0].name, "size_bytes": len(body), "parts": parts})
    assert begun.status_code == 201, begun.text
    answer = begun
    for at in range(0, len(body), 10_000):
        piece = body[at : at + 10_000]
        path = f"/api/v1/uploads/{begun.json()['upload_id']}?offset={at}"
        answer = client.post(path, content=piece, headers=OCTETS)
    return answer


SAID_OF_MAP = {"map_version": "site-1", "frame": "map", "metres_per_cell": 0.5, "reason": "surveyed"}


def zipped(file: Path, *members: Path, folder: str = "drive") -> Path:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for one in members:
            archive.write(one, f"{folder}/{one.name}")
    return file


@pytest.mark.parametrize("as_zip", [False, True])
def test_a_floor_map_is_shown_with_its_map_version_once_its_frame_and_unit_are_said(
    stand: Stand, operator: TestClient, tmp_path: Path, as_zip: bool
) -> None:
    files = floor_map(tmp_path)
    sent = (
        uploaded(operator, zipped(tmp_path / "hall.zip", *files)) if as_zip else sent_together(operator, *files).json()
    )
    assert (sent["kind"], sent["received_bytes"]) == ("map", sent["size_bytes"])
    path = f"/api/v1/uploads/{sent['upload_id']}/map"
    assert operator.post(path, json={"map_version": "site-1"}).status_code == 422, "frame and unit are asked for"
    other = operator.post(path, json=SAID_OF_MAP | {"metres_per_cell": 0.1})
    assert (other.status_code, other.json()["reason"]["code"]) == (422, "map_unit_differs")
    found = operator.post(path, json=SAID_OF_MAP)
    assert found.status_code == 200, found.text
    assert found.json()["points"] == 2 * 160 + 2 * 118
    assert found.json()["high_m"][:2] == pytest.approx([39.75, 29.75])
    assert operator.get("/api/v1/maps/site-1/cloud").json()["source"] == "hall.yaml"


def test_a_floor_map_never_replaces_the_picture_of_a_map_silently(
    stand: Stand, operator: TestClient, tmp_path: Path
) -> None:
    first = uploaded(operator, cloud(tmp_path))
    said = {"map_version": "site-1", "frame": "map", "metres_per_unit": 1, "reason": "scan"}
    assert operator.post(f"/api/v1/uploads/{first['upload_id']}/cloud", json=said).status_code == 200
    sent = sent_together(operator, *floor_map(tmp_path)).json()
    path = f"/api/v1/uploads/{sent['upload_id']}/map"
    kept = operator.post(path, json=SAID_OF_MAP)
    assert (kept.status_code, kept.json()["rule"]) == (409, "map_has_cloud")
    assert operator.get("/api/v1/maps/site-1/cloud").json()["source"] == "hall.pcd"
    assert operator.post(path, json=SAID_OF_MAP | {"replace": True}).status_code == 200
    site = stand.harness.runtime.site
    assert (site.map_version, len(site.places)) == ("site-1", len(site.places)), "the site itself is as it was"


def test_a_floor_map_in_other_units_puts_the_sites_places_off_its_floor_and_is_refused(
    operator: TestClient, tmp_path: Path
) -> None:
    sent = sent_together(operator, *floor_map(tmp_path, resolution=0.05)).json()
    said = SAID_OF_MAP | {"metres_per_cell": 0.05}
    answer = operator.post(f"/api/v1/uploads/{sent['upload_id']}/map", json=said)
    assert (answer.status_code, answer.json()["reason"]["code"]) == (422, "map_places_off_floor")
    elsewhere = operator.post(f"/api/v1/uploads/{sent['upload_id']}/map", json=said | {"map_version": "toy-1"})
    assert elsewhere.status_code == 200, "of another map nobody knows where its places are"


def test_a_floor_map_without_its_image_or_with_a_way_out_of_its_folder_is_refused(
    operator: TestClient, tmp_path: Path
) -> None:
    described, drawn = floor_map(tmp_path)
    lonely = operator.post(
        "/api/v1/uploads",
        json={"name": "hall.yaml", "size_bytes": 9, "parts": [{"name": "hall.yaml", "size_bytes": 9}]},
    )
    assert (lonely.status_code, lonely.json()["reason"]["code"]) == (422, "upload_folder_unknown")
    described, drawn = floor_map(tmp_path, image="../../../../../../etc/hostname")
    sent = sent_together(operator, described, drawn).json()
    answer = operator.post(f"/api/v1/uploads/{sent['upload_id']}/map", json=SAID_OF_MAP)
    assert answer.status_code == 422, answer.text


@pytest.mark.parametrize("as_zip", [False, True])
def test_a_rosbag2_folder_is_replayed_from_its_files_or_a_zip(
    stand: Stand, operator: TestClient, tmp_path: Path, as_zip: bool
) -> None:
    folder = rosbag2_drive(tmp_path / "drive")
    files = sorted(folder.iterdir())
    assert "metadata.yaml" in [one.name for one in files]
    if as_zip:
        sent = uploaded(operator, zipped(tmp_path / "drive.zip", *files))
    else:
        sent = sent_together(operator, *files).json()
    assert sent["kind"] == "recording"
    asked = operator.post(f"/api/v1/uploads/{sent['upload_id']}/replay", json={"target_x_m": 6.0, "target_y_m": 0.0})
    stand.app.state.console.replays.step()
    job = operator.get(f"/api/v1/replays/{asked.json()['replay_id']}").json()
    assert job["state"] == "ended", job
    assert job["mission_id"] and job["status"] in ("succeeded", "failed")


def test_the_form_takes_several_files_without_scripts(stand: Stand, operator: TestClient, tmp_path: Path) -> None:
    described, drawn = floor_map(tmp_path)
    files = [("file", (one.name, one.read_bytes())) for one in (described, drawn)]
    assert operator.post("/recordings", files=files).status_code == 303
    (sent,) = operator.get("/api/v1/uploads").json()
    assert sent["kind"] == "map" and "floor map" in operator.get("/recordings").text


@pytest.mark.parametrize(
    ("name", "code"),
    [("nothing", "zip_unreadable"), ("strangers", "upload_folder_unknown"), ("above", "zip_not_a_folder"),
     ("two", "zip_not_a_folder"), ("bomb", "zip_too_large")],
)  # fmt: skip
def test_a_zip_that_lies_is_refused_and_leaves_nothing(tmp_path: Path, name: str, code: str) -> None:
    file = tmp_path / f"{name}.zip"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        match name:
            case "strangers":
                archive.writestr("a/readme.txt", "hello")
            case "above":
                archive.writestr("../metadata.yaml", "x")
            case "two":
                archive.writestr("a/metadata.yaml", "x")
                archive.writestr("b/metadata.yaml", "x")
            case "bomb":
                archive.writestr("a/metadata.yaml", b"\0" * 5_000_000)
    if name == "nothing":
        file.write_bytes(b"PK nothing of the kind")
    uploads = store(tmp_path / "uploads")
    body = file.read_bytes()
    begun = uploads.begin(file.name, size_bytes=len(body), by="ada")
    with pytest.raises(ContractInvalid) as refused:
        uploads.add(begun.upload_id, offset=0, piece=body, by="ada")
    assert refused.value.reason.code == code
    assert uploads.all() == () and not list((tmp_path / "uploads").iterdir())
