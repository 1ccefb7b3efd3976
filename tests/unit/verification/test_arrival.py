"""Arrival is what was measured: near, fresh, at rest, and told alike by localiser and odometry (D18)."""

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.evidence import EvidencePacket
from tests.unit.verification.building import (
    STATIC,
    Bench,
    arrival,
    card,
    contract,
    mission,
    node,
    only,
    receipt,
    retained,
)
from tests.unit.verification.drives import BEGAN_S, Drive, sealed

ARRIVAL = "harness.verification.predicates.arrival:arrival"


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.ledger("R104", "R213", symbol=ARRIVAL)
def test_a_body_at_rest_within_the_radius_in_three_fresh_samples_has_arrived(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive())))
    assert (result.verdict, result.age_s is not None and result.age_s < 1.0) == ("satisfied", True)
    assert result.measured["distance_m"] < 0.05
    assert result.measured["samples"] == 3
    assert result.measured["path_length_m"] == pytest.approx(7.0, abs=0.2)
    assert result.bounds["distance_m"] == 0.4
    assert set(result.sources) == {"localiser", "odometry"}


@pytest.mark.parametrize(("short_m", "verdict"), [(0.30, "satisfied"), (0.50, "violated")])
@pytest.mark.ledger("R213", symbol="harness.verification.predicates.arrival:_within")
def test_the_arrival_radius_is_the_tolerance_of_the_condition(bench: Bench, short_m: float, verdict: str) -> None:
    assert bench.judged(bench.driven(Drive(until_m=7.0 - short_m))).verdict == verdict


@pytest.mark.ledger("R109", "R108", symbol=ARRIVAL)
def test_a_provider_that_declares_success_two_metres_short_has_not_arrived(bench: Bench) -> None:
    early = bench.driven(
        Drive(until_m=4.9),
        declared={"distance_m": 0.1},
        receipts=(receipt("arrival", at_s=BEGAN_S + 5, text="GOAL REACHED", values={"distance_m": 0.1}),),
    )
    result = only(bench.judged(early))
    assert result.verdict == "violated"
    assert result.measured["distance_m"] == pytest.approx(2.1, abs=0.05)


@pytest.mark.ledger("R103", "R105", symbol="harness.verification.admission:stale")
def test_a_stale_pose_makes_the_verdict_stale(bench: Bench) -> None:
    verdict = bench.judged(bench.driven(Drive(restamp_after_m=3.5)))
    assert verdict.verdict == "stale"
    assert "old, limit 1.00 s" in sentence(verdict.reason)


def test_poses_at_the_goal_that_are_too_old_when_collected_are_stale(bench: Bench) -> None:
    packet = bench.driven(Drive())
    assert bench.judged(replace(packet, collected_s=packet.collected_s + 1.5)).verdict == "stale"


@pytest.mark.parametrize("silent_after_m", [0.0, 3.5])
@pytest.mark.ledger("R45", "R104", symbol="harness.verification.predicates.arrival:arrival")
def test_missing_poses_make_the_verdict_ambiguous(bench: Bench, silent_after_m: float) -> None:
    assert bench.judged(bench.driven(Drive(silent_after_m=silent_after_m))).verdict == "ambiguous"


@pytest.mark.ledger("R104", symbol="harness.verification.predicates.arrival:_trusted")
def test_a_localiser_that_froze_before_the_goal_disagrees_with_odometry(bench: Bench) -> None:
    result = only(bench.judged(bench.driven(Drive(freeze_after_m=5.5))))
    assert result.verdict == "ambiguous"
    assert "sources disagree" in sentence(result.reason)
    assert result.measured["disagreement_m"] > result.bounds["disagreement_m"]


def test_a_localiser_that_froze_inside_the_radius_is_not_believed_either(bench: Bench) -> None:
    through = Drive(route=((0.0, 0.0), (6.0, 0.0)), freeze_after_m=4.0)
    frozen = bench.driven(through)
    there = mission(contract(node(arrival((4.0, 0.0)))))
    assert bench.judged(frozen, there).verdict == "ambiguous"


def test_a_body_that_creeps_to_its_end_does_not_hide_a_frozen_localiser(bench: Bench) -> None:
    drive = Drive(route=((0.0, 0.0), (8.0, 0.0)), before_s=0.0, after_s=8.0, until_m=6.0)
    samples = drive.trajectory()

    def creeping(at_s: float) -> float:
        return 0.01 * min(max(at_s - drive.stopped_s, 0.0), 6.0)

    crept = replace(
        samples,
        odometry=tuple(replace(one, y_m=one.y_m + creeping(one.at_s)) for one in samples.odometry),
        poses=tuple(replace(pose, x_m=min(pose.x_m, 4.8)) for pose in samples.poses),
    )
    packet = replace(bench.driven(drive), estimates=(bench.trajectory(crept),))
    result = only(bench.judged(packet, mission(contract(node(arrival((5.0, 0.0)))))))
    assert result.measured["distance_m"] < 0.4
    assert (result.verdict, "sources disagree" in sentence(result.reason)) == ("ambiguous", True)


def test_a_position_that_is_odometry_itself_is_labelled_as_a_single_source(bench: Bench) -> None:
    samples = Drive().trajectory()
    alone = replace(samples, poses=tuple(replace(pose, source="odometry") for pose in samples.poses))
    packet = replace(bench.driven(Drive()), estimates=(bench.trajectory(alone),))
    result = only(bench.judged(packet, mission(contract(node(risk="low"))), provider=card("odometry")))
    assert (result.verdict, result.sources, result.independence) == ("satisfied", ("odometry",), 1)
    assert "single source: odometry" in sentence(result.reason)


def looked(bench: Bench, motion: EvidencePacket, look: Drive) -> EvidencePacket:
    """A verify-only packet that cites the motion."""
    packet = bench.driven(look, name="go-2", verify_only=True)
    return replace(packet, cites=(motion.identity.packet_id,))


def standing(motion: Drive, **changes: object) -> Drive:
    """A look from where the motion ended."""
    return Drive(from_s=motion.until_s + 1, from_m=motion.length_m, until_m=motion.length_m, **changes)  # type: ignore[arg-type]


@pytest.mark.ledger("R46", symbol="harness.verification.sources:Sources.since_agreement")
def test_a_localiser_that_is_still_frozen_when_looked_at_again_stays_ambiguous(bench: Bench) -> None:
    motion = Drive(freeze_after_m=5.5)
    first = bench.driven(motion)
    stuck = motion.trajectory().poses[-1]
    look = standing(motion, silent_after_m=0.0)
    samples = look.samples()
    frozen = tuple(
        replace(stuck, seq=10**6 + n, at_s=look.from_s + n / 10)
        for n in range(round((look.until_s - look.from_s) * 10))
    )
    second = replace(looked(bench, first, look), estimates=(bench.trajectory(sealed((*samples, *frozen))),))
    result = only(bench.judged(second, retained(mission(), first)))
    assert result.verdict == "ambiguous"
    assert result.measured["disagreement_m"] == pytest.approx(1.5, abs=0.2)


@pytest.mark.ledger("R46", symbol="harness.verification.predicates.arrival:agreement_of")
def test_a_localiser_that_recovered_satisfies_without_moving_again(bench: Bench) -> None:
    motion = Drive(freeze_after_m=5.5)
    first = bench.driven(motion)
    second = looked(bench, first, standing(motion))
    result = only(bench.judged(second, retained(mission(), first)))
    assert result.verdict == "satisfied"
    assert result.measured["disagreement_m"] < 0.05


def test_a_look_after_a_silent_leg_is_compared_with_the_pose_before_it(bench: Bench) -> None:
    motion = Drive(silent_after_m=0.0)
    before = Drive(from_s=BEGAN_S - 5, from_m=0.0, until_m=0.0)
    reference = bench.trajectory(before.trajectory(), kind="before", until_s=BEGAN_S)
    first = replace(bench.driven(motion), before=(reference,))
    second = looked(bench, first, standing(motion))
    state = retained(mission(), first)
    assert bench.judged(second, state).verdict == "satisfied"


def test_a_localiser_that_comes_back_with_a_place_odometry_never_went_to_is_not_believed(bench: Bench) -> None:
    motion = Drive(until_m=4.0, silent_after_m=0.0)
    before = Drive(from_s=BEGAN_S - 5, from_m=0.0, until_m=0.0)
    first = replace(
        bench.driven(motion), before=(bench.trajectory(before.trajectory(), kind="before", until_s=BEGAN_S),)
    )
    look = standing(motion).trajectory()
    at_target = replace(look, poses=tuple(replace(pose, y_m=pose.y_m + 3.0) for pose in look.poses))
    second = replace(looked(bench, first, standing(motion)), estimates=(bench.trajectory(at_target),))
    result = only(bench.judged(second, retained(mission(), first)))
    assert result.measured["distance_m"] < 0.1
    assert result.verdict == "ambiguous"


def test_a_look_without_any_motion_to_compare_with_is_ambiguous(bench: Bench) -> None:
    motion = Drive()
    packet = bench.driven(standing(motion), verify_only=True)
    assert bench.judged(packet).verdict == "ambiguous"


@pytest.mark.ledger("R92", symbol="harness.verification.body:static_body")
def test_a_body_that_still_moves_has_not_arrived(bench: Bench) -> None:
    moving = Drive(route=((0.0, 0.0), (7.0, 0.0)), after_s=0.0)
    there = mission(contract(node(arrival((7.0, 0.0)))))
    result = only(bench.judged(bench.driven(moving), there))
    assert result.verdict == "violated"
    assert "moved 0.5" in sentence(result.reason)


def test_a_fresh_pose_of_another_map_or_of_low_confidence_is_no_pose(bench: Bench) -> None:
    samples = Drive().trajectory()
    other = replace(samples, poses=tuple(replace(pose, map_version="site-0") for pose in samples.poses))
    weak = replace(samples, poses=tuple(replace(pose, confidence=0.3) for pose in samples.poses))
    for changed in (other, weak):
        packet = replace(bench.driven(Drive()), estimates=(bench.trajectory(changed),))
        result = only(bench.judged(packet))
        assert (result.verdict, "no pose" in sentence(result.reason)) == ("ambiguous", True)


def test_two_samples_with_distinct_sensor_times_are_too_few(bench: Bench) -> None:
    samples = Drive().trajectory()
    two = replace(samples, poses=(*samples.poses[-2:], replace(samples.poses[-1], seq=10**6)))
    packet = replace(bench.driven(Drive()), estimates=(bench.trajectory(two),))
    result = only(bench.judged(packet))
    assert result.verdict == "ambiguous"
    assert result.measured["samples"] == 2


def test_samples_on_both_sides_of_the_radius_decide_nothing(bench: Bench) -> None:
    samples = Drive().trajectory()
    newest = replace(samples.poses[-1], x_m=samples.poses[-1].x_m + 0.6)
    mixed = replace(samples, poses=(*samples.poses[:-1], newest))
    packet = replace(bench.driven(Drive()), estimates=(bench.trajectory(mixed),))
    assert bench.judged(packet).verdict == "ambiguous"


@pytest.mark.ledger("R107", symbol="harness.verification.independence:independence")
def test_a_sensor_that_the_provider_uses_too_is_level_one_and_others_are_level_two(bench: Bench) -> None:
    packet = bench.driven(Drive())
    shared = only(bench.judged(packet, provider=card("localiser", "lidar")))
    apart = only(bench.judged(packet, provider=card("lidar")))
    unknown = only(bench.judged(packet, provider=replace(card(), sources=())))
    assert [one.independence for one in (shared, apart, unknown)] == [1, 2, 1]


@pytest.mark.ledger("R107", symbol="harness.verification.verdict:_admitted")
def test_evidence_below_the_required_independence_is_ambiguous_as_a_single_source(bench: Bench) -> None:
    risky = mission(contract(node(risk="high")))
    result = only(bench.judged(bench.driven(Drive()), risky, provider=card("localiser", "odometry")))
    assert (result.verdict, result.independence, result.required_independence) == ("ambiguous", 1, 2)
    assert "single source" in sentence(result.reason)


@pytest.mark.ledger("R14", "R15", symbol="harness.verification.predicates.static_body:static_body")
def test_all_declared_effects_are_tested_and_the_strictest_counts(bench: Bench) -> None:
    both = mission(contract(node(arrival(), STATIC)))
    moving = bench.judged(bench.driven(Drive(until_m=6.0, after_s=0.0)), both)
    assert [one.verdict for one in moving.results] == ["violated", "violated"]
    good = bench.judged(bench.driven(Drive()), both)
    assert (good.verdict, len(good.results)) == ("satisfied", 2)
