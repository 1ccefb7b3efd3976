"""A configuration that a person edited: read strictly, changed in one section, with their name."""

import msgspec
import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.changes import with_wait
from rsi_reviews.generate.person_edits import Intention, edited

H0 = baseline()
WHY = Intention(reason="Waits are too short at the dock.", intended_effect="Fewer questions.")


def test_an_edit_in_json_becomes_a_candidate_with_the_persons_name() -> None:
    text = msgspec.json.encode(with_wait(H0, 40.0)).decode()
    mine = edited(text, H0, WHY, who="ada")
    assert mine.manifest.component == "recovery" and mine.manifest.author.name == "ada"
    assert mine.manifest.author.kind == "person" and mine.manifest.rollback == H0.configuration_id


def test_an_edit_in_yaml_is_read_as_strictly() -> None:
    text = msgspec.yaml.encode(with_wait(H0, 40.0)).decode()
    assert edited(text, H0, WHY, who="ada").configuration == with_wait(H0, 40.0)
    with pytest.raises(CandidateInvalid) as caught:
        edited(f"{text}gate: {{}}\n", H0, WHY, who="ada")
    assert caught.value.rule == "not_readable"


@pytest.mark.parametrize(
    ("changed", "rule"),
    [
        (H0, "no_change"),
        (replace(with_wait(H0, 40.0), routing=replace(H0.routing, history=2.0)), "other_component"),
    ],
    ids=["nothing", "two sections"],
)
def test_an_edit_changes_exactly_one_section(changed: Configuration, rule: str) -> None:
    with pytest.raises(CandidateInvalid) as caught:
        edited(msgspec.json.encode(changed).decode(), H0, WHY, who="ada")
    assert caught.value.rule == rule
