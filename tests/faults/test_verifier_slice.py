"""A short, seeded slice of the verifier's campaign, and what it must find: a predicate that accepts anything."""

import math
from pathlib import Path
from random import Random

import msgspec
import pytest
from msgspec.structs import replace

from experiments.verifier import campaign, motion, passages, pictures
from experiments.verifier.campaign import FAMILIES, Pools, current_predicates, measured
from experiments.verifier.cases import (
    CaseJudge,
    VerifierCase,
    condition_id_of,
    packet_of,
    shown_goal,
    shown_packet,
    stage,
)
from experiments.verifier.executions import SimulatedExecution, driven, reference_to
from experiments.verifier.matrix import VerifierReport
from experiments.verifier.page import BEGIN, END, publish
from harness.baseline.load import site
from harness.contracts.effects import AnyEffect, Metric, Relational, Temporal
from harness.contracts.ids import Digest, NodeId
from harness.contracts.observations import Trajectory
from harness.contracts.reasons import because
from harness.verification.finding import Finding
from harness.verification.predicates.registry import PREDICATES
from harness.verification.reading import Evidence
from simulator.cards import ROUTE_FOLLOWER

CASES, SEED = 30, 3


def blunt(effect: AnyEffect, evidence: Evidence) -> Finding:
    """A predicate that is satisfied with anything, as fresh and as independent as can be."""
    reason = because("poses_inside", poses=3, region="yard")
    return Finding(verdict="satisfied", reason=reason, sources=("localiser",), age_s=0.0)


@pytest.fixture(scope="module")
def pools() -> Pools:
    return Pools(SEED, whole=False)


@pytest.fixture(scope="module")
def report(pools: Pools) -> VerifierReport:
    return measured(CASES, seed=SEED, pools=pools)


def test_no_false_condition_is_satisfied_unless_every_source_agrees_on_it(report: VerifierReport) -> None:
    assert report.offences == ()
    assert {one.predicate for one in report.predicates} == set(current_predicates())


def test_every_matrix_holds_false_cases_and_true_ones(report: VerifierReport) -> None:
    for one in report.predicates:
        assert one.total.cases >= CASES, one.predicate
        assert one.total.false >= CASES // 10 and one.total.true >= CASES // 10, one.predicate
        assert one.total.satisfied_false == 0 and one.total.refused_false == one.total.false, one.predicate
        assert set(one.faults) - {"none"}, one.predicate


def test_what_can_be_satisfied_is_satisfied_where_nothing_is_wrong(report: VerifierReport) -> None:
    never = {"arrival_without_target", "sighted", "same_image"}
    for one in report.predicates:
        assert bool(one.total.satisfied_true) == (one.predicate not in never), one.predicate


def test_faults_of_every_source_stand_apart(report: VerifierReport) -> None:
    found = {one.predicate: one for one in report.predicates}
    assert any(one.satisfied_false for one in found["arrival"].epistemic.values())
    assert not set(found["arrival"].epistemic) & set(found["arrival"].faults)


@pytest.mark.parametrize(
    ("predicate", "family"),
    [
        (("relational", "inside"), "standing"),
        (("relational", "stayed_out"), "kept out"),
        (("metric", "facing"), "headings"),
    ],
)
def test_a_planted_predicate_that_accepts_anything_is_found(
    predicate: tuple[str, str], family: str, pools: Pools, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PREDICATES, predicate, blunt)
    found = measured(CASES, seed=SEED, only=(family,), pools=pools)
    planted = next(one for one in found.predicates if one.predicate == predicate[1])
    assert planted.total.satisfied_false > CASES // 10 and planted.false_bound > 0.2
    assert any(line.startswith(f"{predicate[1]}: satisfied though false") for line in found.offences)


def answers(cases: list[VerifierCase], fault: str) -> set[str]:
    judge = CaseJudge()
    return {judge.answer(one).verdict for one in cases if one.fault == fault and one.true is False}


def test_a_sweep_before_a_turn_says_nothing_of_the_heading_after_it(pools: Pools) -> None:
    cases = [one for one in pictures.headings(Random(1), 600, pools.looks) if one.fault == "body turns after the sweep"]
    assert cases and "satisfied" not in answers(cases, "body turns after the sweep")


def test_feet_that_slip_in_the_turn_make_no_panorama(pools: Pools) -> None:
    fault = "feet slip in the turn: odometry counts half as much again"
    cases = [one for one in pictures.circles(Random(1), 60, pools.looks) if one.fault == fault]
    assert cases and answers(cases, fault) == {"ambiguous"}


@pytest.mark.parametrize("fault", ["localiser missing", "localiser frozen, fresh stamps", "localiser drops out"])
def test_a_body_that_nobody_saw_did_not_stay_out(fault: str, pools: Pools) -> None:
    cases = [one for one in motion.kept_out(Random(2), 260, pools.drives) if one.fault == fault]
    assert cases and answers(cases, fault) <= {"ambiguous", "violated"}


@pytest.fixture(scope="module")
def drive() -> SimulatedExecution:
    return driven(next(one.waypoints_m for one in site().routes if one.name == "B-A"), seed=SEED)


def out_of(drive: SimulatedExecution, *, at_s: float, legs: dict[float, Trajectory]) -> str:
    """The answer on whether the body stayed out of a square of 0.8 m around where it was, over legs by their begin."""
    x, y, _ = drive.true_at(at_s)
    square = tuple((x + dx, y + dy) for dx, dy in ((-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)))
    effect = Relational(
        predicate="stayed_out",
        relation="stayed_out",
        subject="body",
        object="yard",
        frame="map",
        map_version="site-1",
        region_m=square,
    )
    blobs: dict[Digest, bytes] = {}
    nodes, packets, until_s = [], {}, 0.0
    for index, (from_s, track) in enumerate(legs.items()):
        node = stage(Temporal(predicate="static_body", interval_s=1.0, bound=0.02), node_id=NodeId(f"leg-{index}"))
        until_s = track.odometry[-1].at_s
        estimates = (reference_to(track, blobs),)
        packet = packet_of(node, ROUTE_FOLLOWER, from_s=from_s, until_s=until_s, estimates=estimates)
        nodes.append(node)
        packets[node.node_id] = (packet, 4 + index)
    recent = drive.between(until_s - 3.0, until_s)
    shown = shown_goal(
        (effect,), nodes, packets, blobs, at_s=until_s, recent=(*recent.poses, *recent.odometry, *recent.imu)
    )
    case = VerifierCase("stayed_out", "", False, shown, condition_id_of(effect, "goal"))
    return CaseJudge().answer(case).verdict


def test_a_visit_before_the_first_pose_of_an_execution_is_not_missed(drive: SimulatedExecution) -> None:
    from_s = drive.from_s + 8.0
    seen = drive.between(from_s, from_s + 10.0)
    late = replace(seen, poses=tuple(one for one in seen.poses if one.at_s > from_s + 1.2))
    assert out_of(drive, at_s=from_s + 0.2, legs={from_s: seen}) == "violated"
    assert out_of(drive, at_s=from_s + 0.2, legs={from_s: late}) == "ambiguous"
    assert out_of(drive, at_s=drive.from_s, legs={from_s: late}) == "satisfied"


def test_a_short_execution_without_a_pose_is_not_covered_by_another_one(drive: SimulatedExecution) -> None:
    first_s, then_s = drive.from_s + 8.0, drive.from_s + 14.0
    blind = replace(drive.between(first_s, first_s + 2.3), poses=())
    legs = {first_s: blind, then_s: drive.between(then_s, then_s + 6.0)}
    assert out_of(drive, at_s=first_s + 1.0, legs=legs) == "ambiguous"


def test_a_localiser_frozen_before_a_dispatch_in_motion_is_not_believed(drive: SimulatedExecution) -> None:
    """The execution moves for a few centimetres only, too little for a comparison of its own."""
    until_s = float(drive.terminal_s) + 2.0
    end = drive.true_at(until_s)[:2]
    from_s = max(float(one[0]) for one in drive.truth if math.dist(one[1:3], end) > 0.10)
    track = drive.between(from_s - 1.0, until_s)
    still = track.poses[0]
    hung = replace(track, poses=tuple(replace(still, seq=one.seq, at_s=one.at_s) for one in track.poses))
    answers = []
    for samples in (track, hung):
        last = samples.poses[-1]
        effect = Metric(
            predicate="arrival",
            frame="map",
            map_version="site-1",
            target_m=(last.x_m, last.y_m),
            tolerance_m=0.4,
        )
        blobs: dict[Digest, bytes] = {}
        node = stage(effect, mandatory=("trajectory",))
        parts = [
            Trajectory(
                poses=tuple(one for one in samples.poses if (one.at_s >= from_s) == since),
                odometry=tuple(one for one in samples.odometry if (one.at_s >= from_s) == since),
                imu=tuple(one for one in samples.imu if (one.at_s >= from_s) == since),
            )
            for since in (False, True)
        ]
        packet = packet_of(
            node,
            ROUTE_FOLLOWER,
            from_s=from_s,
            until_s=until_s,
            before=(reference_to(parts[0], blobs, kind="before"),),
            estimates=(reference_to(parts[1], blobs),),
        )
        shown = shown_packet(node, packet, ROUTE_FOLLOWER, blobs)
        answers.append(CaseJudge().answer(VerifierCase("arrival", "", None, shown, condition_id_of(effect))).verdict)
    assert answers == ["satisfied", "ambiguous"]


def test_a_sweep_from_elsewhere_does_not_confirm_an_analysis() -> None:
    fault = "sweep of another scene, freshly stamped"
    pool = passages.scenes(SEED, rendered=0, drawn=12)
    cases = [one for one in passages.passages(Random(1), 200, pool) if one.fault == fault]
    judge = CaseJudge()
    found = [judge.answer(one) for one in cases]
    assert any("sweep_from_elsewhere" in one.codes for one in found)
    assert "satisfied" not in {one.verdict for one in found}


def test_the_page_keeps_its_words_and_gets_its_tables_and_plots(tmp_path: Path, report: VerifierReport) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "verifier.md").write_text(f"Before.\n{BEGIN}\nBEFORE\n{END}\nAfter.\n", encoding="utf-8")
    publish(report, command="make it", code="0" * 64, docs=tmp_path)
    page = (tmp_path / "verifier.md").read_text(encoding="utf-8")
    assert page.startswith("Before.") and page.endswith("After.\n") and "BEFORE" not in page and "`make it`" in page
    assert all(f"### {one.predicate}" in page for one in report.predicates)
    kept = msgspec.json.decode((tmp_path / "results" / "verifier.json").read_bytes())
    assert kept["seed"] == SEED and len(kept["predicates"]) == len(report.predicates)
    assert len(list((tmp_path / "verifier").glob("*.svg"))) == 3


def test_a_seed_draws_the_same_cases_again(pools: Pools) -> None:
    family = FAMILIES["standing"][1]
    once, again = ([one.true for one in family(Random(7), 20, pools)] for _ in range(2))
    assert once == again
    assert campaign.CASES >= 2000
