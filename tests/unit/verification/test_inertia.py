"""Inertia that was felt before, or that the robot declares, may not fall silent where odometry shows motion."""

from typing import Any

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.evidence import EvidencePacket
from harness.contracts.rules import CURRENT_RULES
from harness.contracts.verdicts import ConditionResult
from tests.unit.verification.building import Bench, arrival, card, contract, mission, node, only
from tests.unit.verification.drives import BEGAN_S, Drive

GOING = mission(contract(node(arrival())))
OWN = {"follower": "robot-1", "imu": "robot-1", "localiser": "robot-1", "odometry": "robot-1"}
DECLARING = card(evidence=("pose", "odometry", "imu"))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def judged(bench: Bench, packet: EvidencePacket, *, rules: int = CURRENT_RULES, **given: Any) -> ConditionResult:
    given = {"origins": OWN, **given}
    return only(bench.judged(packet, replace(GOING, rules=rules), **given))


def felt_before(bench: Bench) -> EvidencePacket:
    """A drive without inertia; in the seconds before its dispatch there was some."""
    standing = Drive(from_s=BEGAN_S - 5.0, until_m=0.0).trajectory()
    return bench.driven(Drive(imu=False), before=(replace(bench.trajectory(standing), kind="before"),))


def test_a_robot_that_never_had_inertia_arrives_without_it(bench: Bench) -> None:
    result = judged(bench, bench.driven(Drive(imu=False)))
    assert result.verdict == "satisfied", result.reason


def test_inertia_that_the_card_declares_and_that_never_comes_leaves_arrival_undecided(bench: Bench) -> None:
    result = judged(bench, bench.driven(Drive(imu=False)), provider=DECLARING)
    assert (result.verdict, "inertia" in sentence(result.reason)) == ("ambiguous", True)
    old = judged(bench, bench.driven(Drive(imu=False)), provider=DECLARING, rules=6)
    assert old.verdict == "satisfied", "missions before keep their rules"


def test_inertia_that_was_felt_before_the_dispatch_may_not_stop(bench: Bench) -> None:
    assert judged(bench, felt_before(bench)).verdict == "ambiguous"
    assert judged(bench, felt_before(bench), rules=6).verdict == "satisfied", "missions before keep their rules"


def test_inertia_that_stops_on_the_way_leaves_arrival_undecided(bench: Bench) -> None:
    samples = Drive().trajectory()
    packet = bench.driven(Drive())
    silent = replace(samples, imu=tuple(one for one in samples.imu if one.at_s < BEGAN_S + 1.0))
    result = judged(bench, replace(packet, estimates=(bench.trajectory(silent),)))
    assert (result.verdict, "inertia" in sentence(result.reason)) == ("ambiguous", True)


def test_evidence_of_another_program_need_not_have_the_inertia_that_the_robot_declares(bench: Bench) -> None:
    packet = bench.driven(Drive(imu=False))
    apart = {**OWN, "imu": "topics", "localiser": "topics", "odometry": "topics"}
    assert judged(bench, packet, provider=DECLARING, origins=apart).verdict == "satisfied"


def test_a_body_that_stands_need_not_be_felt(bench: Bench) -> None:
    there = arrival((0.0, 0.0))
    state = replace(mission(contract(node(there))), rules=CURRENT_RULES)
    packet = bench.driven(Drive(until_m=0.0, imu=False))
    assert only(bench.judged(packet, state, provider=DECLARING, origins=OWN)).verdict == "satisfied"
