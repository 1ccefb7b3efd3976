"""Evidence in an S3-compatible bucket: missions, `regen doctor` and erasure as with files."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.cli.main import app
from harness.adapters.stores.blob_address import open_blobs
from harness.auditing.dossier import mission_blobs
from harness.bootstrap import edit_harness, read_harness
from harness.contracts.actors import Actor
from harness.contracts.errors import BlobGone
from harness.contracts.ids import MissionId
from harness.erasures import erase
from harness.settings import HarnessSettings
from tests.builders.object_store import ObjectStore, object_store
from tests.saying import said

OFFLINE = ("--speed", "0", "--fidelity", "kinematic")


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectStore]:
    with object_store(monkeypatch) as running_service:
        yield running_service


def regen(blobs: str, *words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words], env={"REGEN_BLOBS": blobs})


def printed(result: Result) -> Any:
    assert result.exit_code == 0, (result.output, result.exception)
    return json.loads(result.stdout.splitlines()[-1])


def test_a_mission_keeps_its_evidence_in_the_bucket_and_nothing_in_the_data_folder(
    service: ObjectStore, tmp_path: Path
) -> None:
    address, data = service.address(), tmp_path / "data"
    words = ("mission", "run", "circuit", "--data", data, *OFFLINE, "--json")
    mission_id = MissionId(printed(regen(address, *words))["mission_id"])
    assert not [path for path in (data / "blobs").rglob("*") if path.is_file()]
    assert printed(regen(address, "doctor", "--data", data, "--json"))["problems"] == []
    with read_harness(HarnessSettings(data_folder=data, blobs=address)) as runtime:
        cited = mission_blobs(runtime, mission_id)
    assert cited.keys() <= set(open_blobs(address, data / "blobs").digests())


def test_an_erasure_that_the_bucket_missed_is_finished_at_the_next_start(service: ObjectStore, tmp_path: Path) -> None:
    address, data = service.address(), tmp_path / "data"
    settings, blobs = HarnessSettings(data_folder=data, blobs=address), open_blobs(address, data / "blobs")
    photograph = b"\xff\xd8\xff\xe0 of somebody"
    with edit_harness(settings) as runtime:
        picture = runtime.keep(photograph)
        erase(runtime, picture, actor=Actor(name="ada", role="admin"), reason="a face is on it")
        with pytest.raises(BlobGone):
            runtime.blob(picture)
    blobs.put(photograph)
    with edit_harness(settings) as runtime:
        assert not blobs.has(picture)
        assert (found := runtime.erasure(picture)) is not None and found.reason == "a face is on it"


def test_a_bucket_that_is_gone_ends_a_command_with_the_reason(service: ObjectStore, tmp_path: Path) -> None:
    words = ("mission", "run", "circuit", "--data", tmp_path / "data", *OFFLINE)
    assert "object store" in said(regen(service.address(make=False), *words))
    assert "s3://BUCKET" in said(regen("ftp://somewhere", *words))
