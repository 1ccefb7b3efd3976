"""YAML that anybody may have written is read in a process with limits; what unfolds, repeats or nests is refused."""

import datetime
from math import isnan
from pathlib import Path

import pytest

from harness.adapters.bounded_yaml import LIMITS, foreign_values, plain_values
from harness.contracts.errors import ContractInvalid
from harness.workspace.reading import open_workspace
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.person_edits import read_edit

BOMBS = {
    "aliases": ("a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n", "yaml_alias"),
    "depth": ("[" * 5000, "yaml_too_deep"),
    "a key twice": ("a: 1\na: 2\n", "yaml_invalid"),
    "a merged key": ("a: {b: 1}\nc:\n  <<: {d: 1}\n", "yaml_invalid"),
    "a tag": ("a: !!python/object/apply:os.system [ls]\n", "yaml_invalid"),
    "length": ("a: " + "x" * 300_000, "text_too_long"),
    "digits": ("a: " + "9" * 100_000, "value_unreadable"),
    "a number to the base of sixty": ("a: 1" + ":59" * 20_000, "value_unreadable"),
    "a bomb of dates": ("a: 2020-13-45\n", "value_unreadable"),
    "no text": ("a: \x00\n", "yaml_invalid"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_with_its_reason(name: str) -> None:
    text, code = BOMBS[name]
    with pytest.raises(ContractInvalid) as caught:
        foreign_values(text, where="a file")
    assert caught.value.reason.code == code and "a file" in str(caught.value.where)


def test_what_a_process_with_limits_reads_is_what_this_one_would_have_read() -> None:
    text = "a: [1, -2.5, true, null, text]\nb: {c: 2026-11-23, d: .inf}\ne: .nan\nf: !!binary aGk=\n"
    here, there = (read(text, where="here") for read in (plain_values, foreign_values))
    assert isnan(there.pop("e")) and isnan(here.pop("e"))
    assert here.pop("b")["c"] == datetime.date(2026, 11, 23)
    assert there.pop("b")["d"] == float("inf")
    assert here == there


def test_a_long_text_within_the_limits_is_read_within_the_limits() -> None:
    text = "a:\n" + "- {b: 1, c: [x, y]}\n" * 3_000
    assert len(foreign_values(text, where="here")["a"]) == 3_000
    assert LIMITS.memory_bytes <= 256 * 2**20


def test_a_site_file_and_a_candidate_are_read_so(tmp_path: Path) -> None:
    bomb = BOMBS["aliases"][0]
    (tmp_path / "site.yaml").write_text(bomb)
    with pytest.raises(ContractInvalid) as of_site:
        open_workspace(tmp_path)
    with pytest.raises(CandidateInvalid) as of_candidate:
        read_edit(bomb)
    assert of_site.value.reason.code == of_candidate.value.reason.code == "yaml_alias"
