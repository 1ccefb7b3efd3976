"""Every field of a configuration is described, and nothing else is: four sections, their units, bounds and meanings."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import msgspec
import pytest

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from harness.contracts.fields import MEANINGS, Field, fields
from harness.contracts.values import decode, encode


@cache
def known() -> dict[str, Field]:
    """Every described field by its path."""
    return {field.path: field for field in fields()}


def leaves(value: Any, path: str) -> Iterator[str]:
    """Paths of what a described field holds, or of a leaf that nothing describes."""
    if path in known():
        yield path
    elif isinstance(value, dict) and value:
        for name, item in value.items():
            yield from leaves(item, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for item in value:
            yield from leaves(item, f"{path}[]")
    else:
        yield path


def test_every_value_of_h_0_has_a_described_field() -> None:
    shipped = set(leaves(msgspec.json.decode(encode(baseline())), ""))
    assert shipped - set(known()) == set()
    assert len(shipped) > 50


@pytest.mark.ledger("R154", symbol="harness.contracts.fields:fields")
def test_every_field_has_a_section_a_unit_and_a_meaning_and_stands_once() -> None:
    assert {field.section for field in fields()} == set(Configuration.__struct_fields__)
    assert len(known()) == len(fields())
    for field in fields():
        assert field.path.partition(".")[0].partition("[")[0] == field.section
        assert field.unit
        assert field.meaning[0].isupper()
        assert not field.meaning.endswith(".")


def test_no_meaning_is_written_for_a_field_that_is_not_there() -> None:
    for kind, words in MEANINGS.items():
        assert set(words) <= set(kind.__struct_fields__), kind.__name__


@pytest.mark.parametrize(
    ("path", "unit", "bound"),
    [
        ("recovery.wait_s", "s", "number above 0"),
        ("routing.history", "weight", "number of at least 0"),
        ("context_rules.minimum_confidence", "share", "number from 0 to 1"),
        ("context_rules.c1_items", "records", "whole number of at least 0"),
        ("templates[].nodes[].timeout_s", "s", "number above 0"),
        ("templates[].constraints.speed_cap_mps", "m/s", "number above 0"),
        ("templates[].nodes[].risk", "class", "one of high, low, medium"),
    ],
)
def test_a_bound_in_words_is_the_one_the_type_keeps(path: str, unit: str, bound: str) -> None:
    found: Field = known()[path]
    assert (found.unit, found.bound) == (unit, bound)


@pytest.mark.parametrize(
    ("path", "value"),
    [(("recovery", "wait_s"), 0), (("routing", "history"), -0.1), (("context_rules", "minimum_confidence"), 1.1),
     (("context_rules", "c1_items"), 1.5), (("recovery", "gate"), {}), (("gate",), {}), (("suites",), [])],
)  # fmt: skip
def test_a_value_beyond_its_bound_and_a_fifth_section_are_not_read(path: tuple[str, ...], value: object) -> None:
    body = msgspec.json.decode(encode(baseline()))
    within = body
    for name in path[:-1]:
        within = within[name]
    within[path[-1]] = value
    with pytest.raises(msgspec.ValidationError, match=path[-1]):
        decode(msgspec.json.encode(body), Configuration)


@pytest.mark.ledger("R155", symbol="harness.contracts.configuration:Configuration.configuration_id")
def test_the_same_values_have_the_same_id_and_one_figure_makes_another() -> None:
    read_again = decode(encode(baseline()), Configuration)
    assert read_again.configuration_id == baseline().configuration_id
    longer = msgspec.structs.replace(baseline().recovery, wait_s=baseline().recovery.wait_s + 1)
    assert msgspec.structs.replace(baseline(), recovery=longer).configuration_id != baseline().configuration_id
