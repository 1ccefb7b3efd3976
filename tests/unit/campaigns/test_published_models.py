"""What is published of models: each part with the code that it ran on, also where only some were made anew."""

import msgspec
import pytest

from experiments.benchmarks.console_lists import _renamed as renamed
from experiments.campaigns.models import PARTS, RESULTS, CodeOfPart, ModelsReport, RoleFigures, page, renewed
from harness.contracts.events import CommitRejected, NodeCommitted
from harness.contracts.ids import InvocationId, NodeId, PacketId
from harness.contracts.values import decode
from rsi_reviews.evaluation.measures import exact


def figures(role: str, missions: int) -> RoleFigures:
    return RoleFigures(
        role=role, missions=missions, asked=0, admitted=0, refused={}, completed=0, deterministic_completed=0,
        false_completions=exact(0, 1), seconds=0.0, output_tokens=0,
    )  # fmt: skip


def test_a_part_that_is_made_anew_names_its_code_and_the_others_stay_of_theirs() -> None:
    published = decode(RESULTS.read_bytes(), ModelsReport)
    new = CodeOfPart(code="b" * 64, model="another-model")
    fields = msgspec.structs.asdict(published)
    fields = renewed(fields, "planner", {"roles": (figures("planner", 7),)}, new, seed=3)
    found = msgspec.convert(fields, ModelsReport)
    assert found.parts == {**published.parts, "planner": new}
    assert found.injection == published.injection and found.isolation == published.isolation
    kept = {one.role: one.missions for one in published.roles}
    assert {one.role: one.missions for one in found.roles} == {**kept, "planner": 7}
    text = page(found)
    assert "| planner | `bbbbbbbbbbbb` | `another-model` |" in text
    assert all(f"| {part} | " in text for part in PARTS)


def test_two_parts_that_play_roles_are_both_in_the_report() -> None:
    ran = CodeOfPart(code="c" * 64, model="m")
    fields = renewed({}, "planner", {"roles": (figures("planner", 1),)}, ran, seed=1)
    fields = renewed(fields, "advice", {"roles": (figures("advice", 2),)}, ran, seed=1)
    assert [one.role for one in fields["roles"]] == ["planner", "advice"]
    assert set(fields["parts"]) == {"planner", "advice"}


@pytest.mark.parametrize(("number", "kind"), [(9, CommitRejected), (10, NodeCommitted)])
def test_the_benchmark_of_lists_writes_events_that_the_contract_has(number: int, kind: type) -> None:
    committed = NodeCommitted(
        node_id=NodeId("go"), invocation_id=InvocationId("inv"), packet_id=PacketId("pkt_12345678"), facts=()
    )
    assert isinstance(renamed(committed, number), kind)
