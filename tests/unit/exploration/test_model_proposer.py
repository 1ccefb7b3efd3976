"""A model as proposer of targets: it reads all that a proposer may, and what it wishes is admitted or refused."""

import json
from typing import Any

import pytest
from msgspec.structs import replace

from harness.adapters.stores.memory import MemoryBlobStore
from harness.contracts.exploration import BlockedTarget, TargetAnswer
from harness.contracts.ids import NodeId
from harness.exploration.model_proposer import model_proposer
from harness.exploration.targets import answered
from tests.fakes.models import Script, scripted_model
from tests.unit.exploration.test_targets import floor, question


def chosen(said: Script | str, **changes: Any) -> TargetAnswer:
    """What follows from the model's answer on the drawn floor; its image is a blob."""
    grid, blobs = floor(), MemoryBlobStore()
    image = blobs.put(b"\xff\xd8\xff")
    asked = replace(question(grid), image=image, **changes)
    model = scripted_model(said, blobs=blobs, images=True, retries=0)
    return answered(model_proposer(model), question=asked, grid=grid, picture=b"")


def wish(x_m: float, y_m: float) -> str:
    return json.dumps({"x_m": x_m, "y_m": y_m, "reason": "the doorway may lead on"})


def test_an_admissible_wish_is_the_target_with_its_reason_under_the_models_name() -> None:
    answer = chosen(wish(6.5, 3.0))
    assert answer.chosen is not None and answer.chosen.target_m == (6.5, 3.0) and not answer.refused
    assert (answer.planner, answer.chosen.reason) == ("model scripted (scripted-1)", "the doorway may lead on")


@pytest.mark.parametrize("said", [wish(40.0, 40.0), wish(7.0, 5.0), "Leave the building at once.", '{"x_m": 1}'])
def test_a_wish_that_is_refused_or_no_answer_leaves_the_harness_its_own_choice(said: str) -> None:
    answer = chosen(said)
    assert answer.refused and answer.chosen is not None and answer.chosen.target_m not in ((40.0, 40.0), (7.0, 5.0))


def test_the_model_reads_objective_edges_feedback_and_regions_and_sees_the_picture() -> None:
    seen: list[dict[str, Any]] = []

    def said(request: dict[str, Any]) -> str:
        seen.append(request)
        return wish(6.5, 3.0)

    blocked = BlockedTarget(node_id=NodeId("t1"), target_m=(3.0, 2.0), failure="no_progress", reason="a box is there")
    chosen(said, feedback=(blocked,))
    user = seen[0]["messages"][1]["content"]
    read = json.loads(user[0]["text"])
    assert read["objective"] == "Explore the site" and read["edges"] and read["zones_m"] and read["keep_out_m"]
    assert read["feedback"] == [
        {"target_m": [3.0, 2.0], "result": "blocked", "failure": "no_progress", "reason": "a box is there"}
    ]
    assert user[1]["type"] == "image_url"
