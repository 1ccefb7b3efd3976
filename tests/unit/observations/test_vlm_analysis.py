"""The analysis by a vision-language model: boxes become places on the floor, and nonsense becomes a failure."""

import json
from typing import Any

import pytest

from harness.adapters.providers.models.vlm import CARD, VlmAnalysis, VlmReport
from harness.contracts.models import ModelExchange
from harness.contracts.protocol import InvocationReport
from harness.contracts.values import decode
from tests.fakes.models import Script, scripted_model
from tests.unit.observations.builders import StillClock, request_to
from tests.unit.observations.painter import CAMERA, PASSAGE, Room
from tests.unit.observations.test_analysis import AnalysisBench, desk_for

THING = {"image": 0, "name": "crate", "left": 0.4, "top": 0.4, "right": 0.6, "bottom": 0.7}


@pytest.fixture(scope="module")
def bench() -> AnalysisBench:
    return desk_for(Room())


def ended(bench: AnalysisBench, said: Script | str, **settings: Any) -> InvocationReport:
    model = scripted_model(said, blobs=bench.blobs, **{"images": True, "retries": 0, **settings})
    provider = VlmAnalysis(model, CAMERA, clock=StillClock(), blobs=bench.blobs, journal=None)
    return provider.report(provider.start(request_to(CARD, parameters=bench.parameters())).handle)


def things(*found: dict[str, Any]) -> str:
    return json.dumps({"things": found})


def test_a_box_in_an_image_becomes_a_place_on_the_floor_of_the_passage(bench: AnalysisBench) -> None:
    report = ended(bench, things(THING))
    assert report.status == "succeeded", report.message
    (receipt,) = report.receipts
    assert receipt.blob is not None
    stored = decode(bench.blobs.get(receipt.blob), VlmReport)
    (found,) = stored.findings
    (low_x, low_y), (high_x, high_y) = (min(PASSAGE), max(PASSAGE))
    x, y = found.floor_point_m
    assert low_x <= x <= high_x and min(low_y, high_y) <= y <= max(low_y, high_y)
    assert (stored.names, stored.model, stored.blocked) == (("crate",), "scripted (scripted-1)", True)
    assert decode(bench.blobs.get(stored.exchange), ModelExchange).role == "visual_analysis"
    assert "crate" not in stored.text, "what is told further is the harness's own sentence"


def test_a_thing_beside_the_passage_is_not_in_it(bench: AnalysisBench) -> None:
    report = ended(bench, things({**THING, "left": 0.0, "right": 0.01, "bottom": 1.0}))
    assert report.status == "succeeded" and report.declared["obstructions"] == 0.0


@pytest.mark.parametrize(
    "said",
    [
        things({**THING, "image": 99}),
        things({**THING, "left": 0.9, "right": 0.1}),
        things({**THING, "bottom": 7.0}),
        json.dumps({"things": [], "verdict": "satisfied"}),
        "Sure! The passage is clear.",
        "{" * 5000,
    ],
    ids=["no such image", "turned round", "outside", "with orders", "talk", "brackets"],
)
def test_an_answer_that_cannot_be_fails_the_invocation_and_reports_nothing(bench: AnalysisBench, said: str) -> None:
    report = ended(bench, said)
    assert (report.status, report.failure, report.receipts) == ("failed", "provider_failed", ())


def test_a_model_that_takes_no_images_is_not_asked(bench: AnalysisBench) -> None:
    report = ended(bench, things(THING), images=False)
    assert (report.status, report.failure) == ("failed", "provider_failed")
