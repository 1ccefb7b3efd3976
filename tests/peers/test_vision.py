"""Detector and text reader on real photographs and simulated scenes, against labels written down before."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from harness.adapters.providers.models.vision import PictureDescription, described_content
from harness.adapters.vision.observer import LocalPictureObserver
from harness.contracts.ids import sha256
from harness.contracts.values import decode
from simulator import camera, site, solids
from tests.integration.runs import regen

LABELS: dict[str, Any] = yaml.safe_load((Path(__file__).parent / "picture_labels.yaml").read_text(encoding="utf-8"))
LEAST_PHOTOGRAPHS = 4
LEAST_SCENES = 6
QUICK = ("--speed", "0", "--fidelity", "kinematic", "--seed", "3", "--json")


@pytest.fixture(scope="module")
def folder(peers: Path) -> Path:
    if not (peers / "vision" / "installed").exists():
        pytest.skip("the peer vision is not installed: tools/peers.sh")
    return peers / "vision"


@pytest.fixture(scope="module")
def observer(folder: Path) -> Iterator[LocalPictureObserver]:
    made = LocalPictureObserver(folder)
    yield made
    made.close()


def is_correct(label: dict[str, Any], found: PictureDescription) -> bool:
    """As picture_labels.yaml says what a correct description is."""
    named = {one.label for one in found.objects}
    letters = _letters("".join(one.text for one in found.texts))
    read = all(_letters(text) in letters for text in label["texts"])
    return set(label["named"]) <= named <= {*label["named"], *label["there"]} and read


def _letters(text: str) -> str:
    return "".join(sign for sign in text.casefold() if sign.isalnum())


@pytest.mark.real_data
def test_at_least_four_of_the_five_photographs_are_described_correctly(folder: Path, real_data: Path) -> None:
    """From the command line, as a person would try a photograph."""
    correct = []
    for label in LABELS["photographs"]:
        file = real_data / "rgbd_home" / "color" / label["file"]
        done = regen("vision", "describe", file, "--folder", folder, "--json")
        assert done.returncode == 0, done.stderr
        found = decode(done.stdout.encode(), PictureDescription)
        assert len(found.models) == 2 and all(model.digest for model in found.models)
        correct += [label["file"]] if is_correct(label, found) else []
    assert len(correct) >= LEAST_PHOTOGRAPHS, correct


def test_simulated_scenes_are_described_as_well_as_the_documentation_says(observer: LocalPictureObserver) -> None:
    """Flat-coloured boxes are unlike what the detector learnt from: the figure is published, and must not get worse."""
    correct = []
    for label in LABELS["simulated"]:
        scene = site.storage_site()
        for one in label["signs"]:
            sign = solids.sign(
                one["text"], tuple(one["at_m"]), facing_rad=one["facing_rad"], size_m=tuple(one["size_m"])
            )
            if sign.name not in {solid.name for solid in scene.solids}:
                scene = scene.with_solids(sign)
        body = camera.jpeg(camera.render(scene, tuple(label["pose"])))
        correct += [label["name"]] if is_correct(label, described_content(observer, sha256(body), body)) else []
    assert len(correct) >= LEAST_SCENES, correct


def test_a_camera_report_is_described_by_the_models_and_says_which(folder: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    done = regen("mission", "run", "camera-report", "--data", data, *QUICK, REGEN_VISION_FOLDER=str(folder))
    assert done.returncode == 4, done.stderr
    shown = regen("mission", "show", json.loads(done.stdout)["mission_id"], "--data", data, "--json")
    (finding,) = json.loads(shown.stdout)["findings"]
    assert finding["source"] == "vision-description"
    assert "NanoDet-g 416 (COCO)" in finding["text"] and "PP-OCRv6" in finding["text"]
