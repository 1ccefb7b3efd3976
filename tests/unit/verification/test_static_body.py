"""Standing still is shown by odometry or IMU, never by the localiser (D15)."""

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.verification.body import at_rest_until
from harness.verification.finding import Undecidable
from tests.unit.verification.building import STATIC, Bench, contract, mission, node, only
from tests.unit.verification.drives import Drive, sealed

STANDING = mission(contract(node(STATIC)))


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R92", "R14", symbol="harness.verification.body:static_body")
def test_a_second_of_odometry_that_does_not_move_is_static(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive()), STANDING))
    assert result.verdict == "satisfied"
    assert result.measured["displacement_m"] < result.bounds["displacement_m"] == 0.02
    assert result.sources == ("odometry",)


def test_a_body_that_stopped_half_a_second_ago_is_not_static_yet(bench: Bench) -> None:
    assert bench.judged(bench.driven(Drive(after_s=0.5)), STANDING).verdict == "violated"


@pytest.mark.ledger("R92", "R45", symbol="harness.verification.body:_by_imu")
def test_a_localiser_alone_cannot_show_that_the_body_stands(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive(odometry=False, imu=False)), STANDING))
    assert result.verdict == "ambiguous"
    assert "no source outside the localiser" in sentence(result.reason)


def test_an_imu_alone_can_refute_standing_but_not_show_it(bench: Bench) -> None:
    samples = tuple(one for one in Drive(odometry=False).samples() if one.source == "imu")
    calm = replace(bench.driven(Drive()), estimates=(bench.trajectory(sealed(samples)),))
    assert bench.judged(calm, STANDING).verdict == "ambiguous"
    pushed = tuple(replace(one, ax_mps2=0.5) for one in samples)
    moving = replace(calm, estimates=(bench.trajectory(sealed(pushed)),))
    assert bench.judged(moving, STANDING).verdict == "violated"


def test_odometry_that_repeats_one_instant_shows_no_second(bench: Bench) -> None:
    odometry = Drive().trajectory().odometry[-1]
    repeated = tuple(replace(odometry, seq=odometry.seq + n) for n in range(40))
    packet = replace(bench.driven(Drive()), estimates=(bench.trajectory(sealed(repeated)),))
    assert bench.judged(packet, STANDING).verdict == "ambiguous"


def test_odometry_that_ended_long_before_collection_is_stale(bench: Bench) -> None:
    packet = bench.driven(Drive())
    late = replace(packet, collected_s=packet.collected_s + 2.0)
    assert bench.judged(late, STANDING).verdict == "stale"


def test_an_instant_without_a_second_of_odometry_before_it_is_undecidable() -> None:
    odometry = Drive().trajectory().odometry
    assert at_rest_until(odometry, until_s=odometry[-1].at_s) == (pytest.approx(0.0), 0.0)
    with pytest.raises(Undecidable, match="odometry_does_not_cover"):
        at_rest_until(odometry, until_s=odometry[0].at_s + 0.2)
