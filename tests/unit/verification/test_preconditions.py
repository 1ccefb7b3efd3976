"""Preconditions are tested on what is seen now; missing or old state never holds (R18, R173)."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.effects import Precondition
from harness.contracts.evidence import CommittedFact
from harness.contracts.observations import AnySample
from harness.contracts.protocol import RobotStatus
from harness.contracts.verdicts import ConditionResult
from harness.verification.preconditions import verify_preconditions
from tests.unit.verification.building import RULES, fact, node
from tests.unit.verification.drives import BEGAN_S, ROUTE, Drive

STANDING = Drive(until_m=7.0, from_m=7.0, before_s=1.0, after_s=1.0)
SYMBOL = "harness.verification.preconditions:verify_preconditions"


def status(**changes: Any) -> RobotStatus:
    known = RobotStatus(
        robot_id="vbot-1",
        at_s=STANDING.until_s,
        posture="standing",
        armed=False,
        hardware_stop=False,
        charge=0.9,
        localised=True,
        map_version="site-1",
    )
    return replace(known, **changes)


def answer(
    precondition: Precondition,
    *,
    recent: tuple[AnySample, ...] | None = None,
    told: RobotStatus | None = None,
    at_s: float = STANDING.until_s,
    facts: tuple[CommittedFact, ...] = (),
) -> ConditionResult:
    results = verify_preconditions(
        node(preconditions=(precondition,)),
        status=told or status(),
        recent=STANDING.samples() if recent is None else recent,
        facts=facts,
        at_s=at_s,
        rules=RULES,
    )
    assert len(results) == 1
    return results[0]


AT_B = Precondition(predicate="at_place", target_m=ROUTE[-1], tolerance_m=0.4)


@pytest.mark.parametrize(
    "precondition",
    [
        Precondition(predicate="localised"),
        Precondition(predicate="hardware_stop_released"),
        Precondition(predicate="static"),
        AT_B,
    ],
)
@pytest.mark.ledger("R18", symbol=SYMBOL)
def test_a_robot_that_stands_localised_at_the_place_meets_them(precondition: Precondition) -> None:
    assert answer(precondition).verdict == "satisfied"


@pytest.mark.ledger("R18", symbol="harness.verification.preconditions:_localised")
def test_a_robot_without_a_valid_localisation_estimate_is_refused() -> None:
    localised = Precondition(predicate="localised")
    assert answer(localised, told=status(localised=False)).verdict == "violated"
    assert answer(localised, recent=()).verdict == "violated"
    assert answer(localised, told=status(map_version="site-2")).verdict == "ambiguous"


@pytest.mark.ledger("R173", symbol="harness.verification.preconditions:_status_fresh")
def test_safety_state_that_is_old_or_unknown_fails_closed() -> None:
    stop = Precondition(predicate="hardware_stop_released")
    assert answer(stop, told=status(hardware_stop=True)).verdict == "violated"
    assert answer(stop, told=status(at_s=BEGAN_S - 5)).verdict == "ambiguous"


def test_a_body_that_moves_or_whose_odometry_is_silent_is_not_static() -> None:
    static = Precondition(predicate="static")
    moving = Drive(after_s=0.0)
    assert (
        answer(static, recent=moving.samples(), at_s=moving.until_s, told=status(at_s=moving.until_s)).verdict
        == "violated"
    )
    assert answer(static, recent=Drive(odometry=False).samples()).verdict == "ambiguous"
    assert answer(static, at_s=STANDING.until_s + 2).verdict == "ambiguous"


@pytest.mark.ledger("R18", symbol="harness.verification.preconditions:_at_place")
def test_a_committed_arrival_does_not_replace_being_there_now() -> None:
    arrived = fact("arrival", "go", target_m=list(ROUTE[-1]))
    elsewhere = Drive(until_m=0.0)
    result = answer(
        AT_B,
        recent=elsewhere.samples(),
        at_s=elsewhere.until_s,
        told=status(at_s=elsewhere.until_s),
        facts=(arrived,),
    )
    assert (result.verdict, "go.arrival no longer holds" in sentence(result.reason)) == ("violated", True)
    assert answer(AT_B, at_s=STANDING.until_s + 2, facts=(arrived,)).verdict == "ambiguous"
