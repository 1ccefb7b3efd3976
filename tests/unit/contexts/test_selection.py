"""Filters first, each with its reason; then the budget. What is kept out leaves a trace (R68, R69)."""

from typing import Any

import pytest

from harness.contexts.selection import Selection, SelectionItem, budgeted, compile_context
from harness.contracts.contexts import Context, ContextRecord, Role
from harness.contracts.errors import ContextOverflow
from harness.contracts.ids import NodeId
from harness.contracts.values import raw
from tests.saying import raises_saying
from tests.unit.verification.building import mission, view

COMPILE = "harness.contexts.selection:compile_context"


def record(kind: str = "observed", source: str = "lidar", at_s: float = 1000.0, **changes: Any) -> ContextRecord:
    return ContextRecord(
        **{"kind": kind, "origin": "sensor", "source": source, "at_s": at_s, "value": raw({})} | changes
    )


def compiled(
    *items: SelectionItem, role: Role = "planner", budget: int = 10, nodes: frozenset[NodeId] | None = None
) -> Context:
    chosen = Selection(role=role, node_id=None, budget=budget, minimum_confidence=0.5, nodes=nodes)
    return compile_context(view(mission()), items, selection=chosen)


def kept_out(context: Context) -> list[tuple[str, str]]:
    return [(one.source, one.reason) for one in context.withheld]


@pytest.mark.ledger("R68", symbol="harness.contexts.selection:_refusal")
def test_a_record_of_low_confidence_or_of_another_node_is_withheld_with_its_reason() -> None:
    context = compiled(
        SelectionItem(record(source="sure")),
        SelectionItem(record(source="unsure", confidence=0.4)),
        SelectionItem(record(source="elsewhere"), scope=frozenset({NodeId("other")})),
        nodes=frozenset({NodeId("go")}),
    )
    assert [one.source for one in context.records] == ["sure"]
    assert kept_out(context) == [("unsure", "low_confidence"), ("elsewhere", "scope")]


@pytest.mark.ledger("R69", symbol="harness.contexts.selection:_aged")
def test_an_expired_record_is_rejected_and_age_counts_at_the_instant_it_speaks_for() -> None:
    context = compiled(
        SelectionItem(record(source="fresh"), speaks_at_s=1000.9, limit_s=1.0),
        SelectionItem(record(source="expired"), speaks_at_s=1001.1, limit_s=1.0),
        SelectionItem(record(source="of its own time"), speaks_at_s=1000.5, limit_s=1.0),
        SelectionItem(record(source="after the fact", at_s=1001.0), speaks_at_s=1000.0, limit_s=1.0),
        SelectionItem(record(source="ageless", at_s=0.0)),
    )
    assert [one.source for one in context.records] == ["fresh", "of its own time", "ageless"]
    assert kept_out(context) == [("expired", "stale"), ("after the fact", "scope")]


@pytest.mark.ledger("R69", symbol="harness.contexts.conflicts:superseded")
def test_a_newer_record_of_the_same_source_and_subject_takes_its_place() -> None:
    context = compiled(
        SelectionItem(record(at_s=1000.0), subject="passage"),
        SelectionItem(record(at_s=1001.0), subject="passage"),
        SelectionItem(record(at_s=1000.0), subject="door"),
        SelectionItem(record(at_s=1000.0, source="camera"), subject="passage"),
    )
    assert len(context.records) == 3
    assert kept_out(context) == [("lidar", "superseded")]


def says(source: str, value: float | str, at_s: float = 1000.0, name: str = "passage", **changes: Any) -> SelectionItem:
    return SelectionItem(record(source=source, at_s=at_s, **changes), states={name: value}, subject="passage")


@pytest.mark.ledger("R69", symbol="harness.contexts.conflicts:conflicting")
def test_two_sources_that_contradict_each_other_are_both_withheld_until_one_observes_again() -> None:
    torn = compiled(says("lidar", "clear"), says("camera", "blocked", 1001.0), says("bumper", "quiet", name="contact"))
    assert [one.source for one in torn.records] == ["bumper"]
    assert kept_out(torn) == [("lidar", "conflict"), ("camera", "conflict")]
    settled = compiled(says("lidar", "clear"), says("camera", "blocked", 1001.0), says("lidar", "blocked", 1002.0))
    assert [(one.source, one.at_s) for one in settled.records] == [("camera", 1001.0), ("lidar", 1002.0)]


@pytest.mark.ledger("R69", symbol="harness.contexts.conflicts:superseded")
def test_a_person_settles_a_conflict_explicitly() -> None:
    context = compiled(
        says("lidar", "clear"), says("camera", "blocked"), says("operator", "blocked", 1002.0, origin="human")
    )
    assert [one.source for one in context.records] == ["camera", "operator"]


@pytest.mark.parametrize(("x_m", "kept"), [(1.4, 2), (1.6, 0)])
def test_measured_values_contradict_beyond_their_units_tolerance_only(x_m: float, kept: int) -> None:
    assert len(compiled(says("one", 1.0, name="x_m"), says("two", x_m, name="x_m")).records) == kept


@pytest.mark.ledger("R68", symbol="harness.contexts.selection:_within_budget")
def test_over_budget_the_oldest_that_is_not_mandatory_goes() -> None:
    items = [SelectionItem(record(source=str(n), at_s=1000.0 + n)) for n in range(4)]
    context = compiled(SelectionItem(record(source="old", at_s=1.0, mandatory=True)), *items, budget=3)
    assert [one.source for one in context.records] == ["old", "2", "3"]
    assert kept_out(context) == [("0", "budget"), ("1", "budget")]


@pytest.mark.ledger("R67", "R68", symbol="harness.contexts.selection:_within_budget")
def test_a_mandatory_overflow_is_an_error_that_says_what_to_do() -> None:
    items = [SelectionItem(record(source=str(n), mandatory=True)) for n in range(3)]
    with raises_saying(ContextOverflow, match=r"3 mandatory records do not fit .* budget of 2"):
        compiled(*items, budget=2)


def test_a_kind_can_have_a_limit_of_its_own() -> None:
    context = compiled(*budgeted([SelectionItem(record(source=str(n), at_s=float(n))) for n in range(5)], limit=3))
    assert sorted(one.source for one in context.records) == ["2", "3", "4"]


@pytest.mark.parametrize(
    ("origin", "kind", "kept"),
    [
        ("planner", "intention", False),
        ("planner", "after", False),
        ("provider", "after", False),
        ("provider", "message", False),
        ("provider", "receipts", True),
        ("provider", "declared", True),
        ("sensor", "after", True),
    ],
)
@pytest.mark.ledger("R42", "R73", "R76", symbol="harness.contexts.selection:_admissible_evidence")
def test_c3_refuses_the_planners_conclusions_and_the_providers_prose(origin: str, kind: str, kept: bool) -> None:
    item = SelectionItem(record(kind=kind, origin=origin))
    assert len(compiled(item, role="verifier").records) == (1 if kept else 0)
    assert len(compiled(item, role="skill").records) == 1
