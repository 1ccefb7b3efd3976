"""Facts are bound values of satisfied conditions; no provider's prose enters them."""

import pytest

from harness.verification.facts import facts_of, finding_in_words
from tests.unit.verification.building import STATIC, Bench, arrival, contract, mission, node
from tests.unit.verification.drives import Drive
from tests.unit.verification.stages import inspection, photographed


@pytest.mark.ledger("R38", symbol="harness.verification.facts:facts_of")
def test_a_fact_names_its_packet_its_condition_its_version_and_what_was_measured() -> None:
    bench = Bench()
    packet = bench.driven(Drive())
    verdict = bench.judged(packet)
    (made,) = facts_of(verdict, packet=packet, node=node(), k=4)
    assert (made.name, made.packet_id, made.condition_id, made.k) == ("arrival", "go-1", "go.arrival", 4)
    assert made.measured["distance_m"] < 0.1
    assert made.arguments["map_version"] == "site-1"


@pytest.mark.ledger("R34", symbol="harness.verification.facts:facts_of")
def test_a_condition_that_is_not_satisfied_makes_no_fact() -> None:
    bench = Bench()
    both = node(arrival((0.0, 0.0)), STATIC)
    packet = bench.driven(Drive())
    made = facts_of(bench.judged(packet, mission(contract(both))), packet=packet, node=both, k=4)
    assert [fact.name for fact in made] == ["static_body"]


def test_a_panoramas_fact_binds_its_frames_and_where_they_were_taken() -> None:
    bench = Bench()
    packet = photographed(bench)
    task = inspection()
    made = facts_of(bench.judged(packet, mission(task)), packet=packet, node=task.node(packet.identity.node_id), k=4)
    arguments = made[0].arguments
    assert arguments["frames"] == [one.blob for one in packet.after]
    assert [index for index, _ in arguments["yaws_rad"]] == [float(n) for n in range(8)]
    assert arguments["position"] == pytest.approx([2.0, 1.0])


@pytest.mark.parametrize(
    ("measured", "said"),
    [
        ({"obstructions": 0.0, "blocked": 0.0}, "The passage is clear: nothing stands on its floor."),
        (
            {"obstructions": 1.0, "blocked": 1.0, "share_0": 0.4},
            "The passage is obstructed: one thing stands on its floor, taking 40% of its width.",
        ),
        (
            {"obstructions": 2.0, "blocked": 1.0, "share_0": 0.4, "share_1": 0.25},
            "The passage is obstructed: 2 things stand on its floor, taking 40% and 25% of its width.",
        ),
    ],
)
def test_a_finding_is_said_in_the_harnesss_own_words(measured: dict[str, float], said: str) -> None:
    assert finding_in_words(measured) == said
