"""The hard filter: each reason by itself, in a fixed order, closed on what is unknown."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.capabilities import CapabilityCard, Parameter
from harness.contracts.ids import NodeId, ProviderId
from harness.contracts.proposals import Filter
from harness.contracts.reasons import Reason
from harness.routing.filter import CHECKS, refusal
from tests.unit.planning.building import NAVIGATION, NOW_S, card, contract, status
from tests.unit.routing.building import need


def stated(**parameters: Any) -> dict[str, Any]:
    return {**contract().node(NodeId("go")).parameters, **parameters}


def low_risk() -> Any:
    return replace(contract().node(NodeId("go")), risk="low")


REFUSALS: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    ("capability", {"capability": "speak"}, {}, "offers speak, not navigate"),
    ("embodiment", {"embodiments": ("arm",)}, {}, "made for arm, not for quadruped"),
    ("parameters", {}, {"parameters": {}}, "parameter route is required"),
    ("parameters", {}, {"parameters": stated(frame=4.0)}, "parameter frame is no frame"),
    ("parameters", {}, {"parameters": stated(speed_cap_mps=0.9)}, "speed_cap_mps = 0.9 is above 0.5 m/s"),
    ("parameters", {}, {"parameters": stated(tolerance_m=0.01)}, "tolerance_m = 0.01 is below 0.05 m"),
    ("parameters", {}, {"parameters": stated(target=(1.0, float("nan")))}, "parameter target is no point"),
    ("parameters", {}, {"parameters": stated(route="round the block")}, "parameter route is no points"),
    ("preconditions", {}, {"status": status(localised=False)}, "not localised"),
    ("preconditions", {}, {"status": None}, "condition is unknown"),
    (
        "preconditions",
        {"preconditions": ("hardware_stop_released",)},
        {"status": status(hardware_stop=True)},
        "engaged",
    ),
    ("preconditions", {"preconditions": ("standing",)}, {"status": status(posture="lying")}, "lies down"),
    ("preconditions", {"preconditions": ("static",)}, {"status": status(posture="moving")}, "the robot moves"),
    ("preconditions", {"preconditions": ("disarmed",)}, {"status": status(armed=True)}, "is armed"),
    ("preconditions", {"preconditions": ("in_good_mood",)}, {}, "in_good_mood cannot be tested"),
    ("freshness", {}, {"status": status(at_s=NOW_S - 2.5)}, "2.5 s old, at most 2.0 s"),
    ("freshness", {"preconditions": ()}, {"status": None}, "condition is unknown"),
    ("freshness", {}, {"status": status(map_version="site-0")}, "on map site-0, the task on site-1"),
    ("safety", {"risk": "high"}, {}, "risk high exceeds the stage's medium"),
    ("safety", {"risk": "medium"}, {"node": low_risk()}, "risk medium exceeds the stage's low"),
    ("safety", {}, {"vetoes": {"base": "bumper"}}, "base vetoed: bumper"),
    ("safety", {}, {"status": status(charge=0.1)}, "charge 0.10 is below 0.15"),
    ("excluded", {}, {"excluded": (ProviderId("route-follower"),)}, "given up"),
]


@pytest.mark.ledger("R58", symbol="harness.routing.filter:refusal")
@pytest.mark.parametrize(("name", "on_card", "on_need", "says"), REFUSALS)
def test_each_filter_refuses_by_its_own_name_and_reason(
    name: str, on_card: dict[str, Any], on_need: dict[str, Any], says: str
) -> None:
    refused = refusal(card(**on_card), need(**on_need))
    assert refused is not None and refused[0] == name
    assert says in sentence(refused[1])


def rule_of(found: tuple[Filter, Reason] | None) -> str:
    return found[0] if found else ""


def test_a_provider_that_fits_is_refused_by_nothing() -> None:
    assert refusal(card(), need()) is None
    assert refusal(card(embodiments=("any",)), need()) is None


def test_the_filters_stand_in_the_papers_order_and_the_first_one_speaks() -> None:
    assert [name for name, _ in CHECKS] == [
        "capability", "embodiment", "parameters", "preconditions", "freshness", "safety", "excluded",
    ]  # fmt: skip
    worst = card(capability="speak", embodiments=("arm",), risk="high")
    hopeless = need(status=None, parameters={}, vetoes={"base": "no"}, excluded=(ProviderId("route-follower"),))
    assert rule_of(refusal(worst, hopeless)) == "capability"
    assert rule_of(refusal(replace(worst, capability="navigate"), hopeless)) == "embodiment"
    assert rule_of(refusal(replace(worst, capability="navigate", embodiments=("any",)), hopeless)) == "parameters"


def test_a_veto_stops_motion_and_lets_the_rest_go_on() -> None:
    still = card(moves=False)
    assert refusal(still, need(vetoes={"base": "bumper"})) is None


def test_a_parameter_that_facts_will_fill_is_no_reason_to_refuse() -> None:
    images = Parameter(name="images", type="digests")
    looking: CapabilityCard = card(parameters=(images,))
    assert refusal(looking, need(parameters={"images": "@{panorama.frames}"})) is None
    assert refusal(looking, need(parameters={"images_from": "@{panorama.frames}"})) is None
    assert rule_of(refusal(looking, need(parameters={"images": "some pictures"}))) == "parameters"
    assert rule_of(refusal(looking, need(parameters={}))) == "parameters"


def test_a_switch_is_no_number_and_a_number_no_switch() -> None:
    replan = next(parameter for parameter in NAVIGATION if parameter.name == "replan")
    assert rule_of(refusal(card(parameters=(replan,)), need(parameters={"replan": 1.0}))) == "parameters"
    number = Parameter(name="frames", type="number")
    assert rule_of(refusal(card(parameters=(number,)), need(parameters={"frames": True}))) == "parameters"
