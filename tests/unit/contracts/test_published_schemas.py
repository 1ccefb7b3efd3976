"""The published JSON Schemas equal what the code gives, and accept what the code stores."""

import json
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest

from harness.contracts.published_schemas import PUBLISHED, schema_files
from harness.contracts.values import encode
from harness.projections.mission import Mission
from tests.builders.missions_run import ran

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "schemas"


def test_the_files_are_what_regen_schemas_writes() -> None:
    assert {file.name: file.read_bytes() for file in FOLDER.glob("*.json")} == schema_files()


@pytest.fixture(scope="module")
def mission() -> Iterator[Mission]:
    with ran("circuit") as found:
        yield found.mission


@pytest.mark.parametrize("name", ["evidence-packet", "node-verdict", "goal-verdict", "task-contract"])
def test_what_a_mission_stored_fits_its_schema_and_a_broken_one_does_not(mission: Mission, name: str) -> None:
    node = mission.nodes["circuit"]  # type: ignore[index]
    value = {
        "evidence-packet": node.packets[-1],
        "node-verdict": node.verdicts[-1],
        "goal-verdict": mission.goal_verdict,
        "task-contract": mission.contract,
    }[name]
    assert isinstance(value, PUBLISHED[name][0])
    schema = json.loads(schema_files()[f"{name}.v1.schema.json"])
    body = json.loads(encode(value))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(body, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**body, "verdict" if "verdict" in name else "goal": 7, "identity": 7}, schema)
