"""Whole missions under every arm: what each lets pass, what it costs, and that the harness cannot select them."""

from pathlib import Path

import grimp
import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from app.cli.main import app
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest
from harness.settings import HarnessSettings
from rsi_reviews.evaluation.adjudicator import adjudicate
from rsi_reviews.evaluation.arms import ARMS, ArmCase, run
from rsi_reviews.evaluation.measures import JudgedMission
from rsi_reviews.evaluation.missions import CONDITIONS, MISSIONS, MissionName, condition
from rsi_reviews.evaluation.protocol import ProtocolRequest, judged, rows
from rsi_reviews.evaluation.report import BEGIN, END, evaluation, figures, load, save, with_figures
from rsi_reviews.evaluation.roles import RoleReport
from rsi_reviews.evaluation.rules import BINDING, BOUND, EVIDENCE
from rsi_reviews.evaluation.suites import checks
from simulator.in_process import SIMULATOR
from tests.saying import raises_saying

GATED, UNSEEN = "evidence-gated", ("biased-localiser", "place-aliasing")


def row(arm: str, fault: str, mission: MissionName = "patrol", seed: int = 5) -> JudgedMission:
    """One judged mission."""
    return judged(ArmCase(arm=arm, condition=condition(fault), mission=mission, seed=seed), SIMULATOR)


@pytest.mark.ledger("R227", symbol="rsi_reviews.evaluation.arms:run")
@pytest.mark.parametrize("mission", ["circuit", "patrol"])
def test_without_faults_all_three_modes_walk_the_same_routes_and_succeed(mission: MissionName) -> None:
    stories = [
        run(ArmCase(arm=arm, condition=condition("nominal"), mission=mission, seed=5), SIMULATOR).story
        for arm in ("direct", "monitored", GATED)
    ]
    assert all(adjudicate(story)["success"] for story in stories)
    assert stories[0]["routes"] == stories[1]["routes"] == stories[2]["routes"]
    walked = [[(start["node_id"], start["provider_id"]) for start in story["starts"]] for story in stories]
    assert walked[0] == walked[1] == walked[2]
    assert [story["claims"][0]["node_id"] == "request" for story in stories] == [False, False, True]


@pytest.mark.parametrize("mission", ["circuit", "patrol"])
def test_a_success_declared_too_soon_passes_all_but_those_who_look(mission: MissionName) -> None:
    found = {arm: row(arm, "success-too-soon", mission) for arm in ("direct", "monitored", "behaviour-tree", GATED)}
    assert {arm: one.contract_false > 0 for arm, one in found.items()} == {
        "direct": True, "monitored": True, "behaviour-tree": False, GATED: False,
    }  # fmt: skip
    assert found[GATED].success
    assert found[GATED].recovery == "recovered"


@pytest.mark.ledger("R228", symbol="rsi_reviews.evaluation.missions:condition")
@pytest.mark.parametrize("fault", [one.name for one in CONDITIONS if one.protocol])
def test_under_each_of_the_five_faults_the_gate_declares_only_what_truly_happened(fault: str) -> None:
    story = run(ArmCase(arm=GATED, condition=condition(fault), mission="patrol", seed=6), SIMULATOR).story
    verdict = adjudicate(story)
    struck = [line["text"].partition("=")[0] for line in story["truth"] if line["kind"] == "struck"]
    assert struck == [name.partition(":")[0] for name in condition(fault).faults]
    assert verdict["success"]
    assert (verdict["contract_false"], verdict["duplicate_starts"]) == ([], [])
    with pytest.raises(UnknownName):
        condition(f"{fault}-or-so")


@pytest.mark.parametrize("fault", UNSEEN)
@pytest.mark.parametrize("arm", ["direct", GATED])
def test_what_fools_every_sensor_is_an_epistemic_false_completion_in_every_arm(arm: str, fault: str) -> None:
    found = row(arm, fault)
    assert found.epistemic_false > 0
    assert found.contract_false == 0


@pytest.mark.ledger("R229", symbol="rsi_reviews.evaluation.rules:arrived")
def test_evidence_that_is_bound_to_nothing_lets_another_mission_s_evidence_pass() -> None:
    assert set(BOUND) == {*BINDING, *EVIDENCE}
    for mission in MISSIONS:
        assert row("bound-driver", "success-too-soon", mission).success
        assert row("no-evidence-binding", "success-too-soon", mission).contract_false == 1


def test_without_recovery_a_passing_fault_goes_to_a_person() -> None:
    assert row("no-recovery", "run-interrupted").recovery == "handed off"
    assert row(GATED, "run-interrupted").recovery == "recovered"


@pytest.mark.ledger("R231", symbol="rsi_reviews.evaluation.driver:Driver._leg")
def test_recovery_without_a_bound_spends_what_the_bound_saves() -> None:
    bound, unbounded = (row(arm, "success-too-soon-always") for arm in ("bound-driver", "unbounded-recovery"))
    assert (bound.recovery, unbounded.recovery) == ("handed off", "handed off")
    assert bound.spent <= 4 < 20 < unbounded.spent
    assert row("bound-driver", "success-too-soon").recovery == "recovered"
    assert row("bound-driver", "nominal").recovery == "not needed"


def test_the_report_of_another_mission_is_taken_for_the_own_where_nothing_binds_it() -> None:
    assert row("monitored", "foreign-report", "circuit").contract_false == 1
    assert row("bound-driver", "foreign-report", "circuit").success
    for mission in MISSIONS:
        assert row(GATED, "foreign-report", mission).success


def test_always_handing_off_moves_nothing_and_is_never_a_success() -> None:
    found = row("always-hands-off", "nominal")
    assert (found.handoffs, found.starts, found.success, found.contract_false) == (1, 0, False, 0)


@pytest.mark.ledger("R233", symbol="rsi_reviews.evaluation.adjudicator:truly_done")
def test_the_judge_and_the_judged_share_no_measurement() -> None:
    graph = grimp.build_graph("app", "harness", "rsi_reviews", cache_dir=None)
    judge = graph.find_upstream_modules("rsi_reviews.evaluation.adjudicator", as_package=False)
    rules = graph.find_upstream_modules("rsi_reviews.evaluation.rules")
    assert judge & rules == set()
    skipped = row("direct", "success-too-soon", "patrol")
    assert (skipped.status, skipped.truly_done) == ("succeeded", False)
    assert row("direct", "nominal", "patrol").truly_done


def test_nothing_of_the_harness_knows_the_arms() -> None:
    graph = grimp.build_graph("app", "harness", "rsi_reviews", cache_dir=None)
    knowing = graph.find_downstream_modules("rsi_reviews.evaluation", as_package=True)
    assert not any(name.partition(".")[0] == "harness" for name in knowing)
    words = " ".join(str(field) for field in HarnessSettings.model_fields.values()).lower()
    assert not any(arm.name in words for arm in ARMS if arm.name != "direct")
    assert not {"arm", "rules", "gate", "ablation"} & set(HarnessSettings.model_fields)


@pytest.mark.ledger("R226", symbol="rsi_reviews.evaluation.suites:checks")
@pytest.mark.ledger("R166", symbol="rsi_reviews.evaluation.suites:matched_regression")
def test_both_check_suites_hold() -> None:
    found = checks(2, SIMULATOR)
    assert {one.suite for one in found} == {"execution", "RSI"}
    assert [(one.name, one.seen) for one in found if not one.holds] == []
    assert len(found) == 9


def test_a_run_that_broke_off_goes_on_and_comes_out_the_same(tmp_path: Path) -> None:
    kept = tmp_path / "missions.jsonl"
    ask = ProtocolRequest(missions=2, seed=3, arms=("direct",), conditions=("nominal", "success-too-soon"))
    whole = rows(ask, SIMULATOR, processes=1, results=kept)
    lines = kept.read_bytes().splitlines(keepends=True)
    kept.write_bytes(b"".join(lines[:3]) + lines[3][:40])
    counted: list[int] = []
    again = rows(ask, SIMULATOR, processes=1, results=kept, progress=lambda done, of: counted.append(done))
    assert counted[0] == 2
    assert [_timeless(one) for one in again] == [_timeless(one) for one in whole]


def test_finished_missions_of_another_seed_are_not_mixed_in(tmp_path: Path) -> None:
    kept = tmp_path / "missions.jsonl"
    rows(
        ProtocolRequest(missions=1, seed=3, arms=("always-hands-off",), conditions=("nominal",)),
        SIMULATOR,
        processes=1,
        results=kept,
    )
    with raises_saying(ContractInvalid, match="another seed"):
        rows(
            ProtocolRequest(missions=1, seed=4, arms=("always-hands-off",), conditions=("nominal",)),
            SIMULATOR,
            processes=1,
            results=kept,
        )


def test_processes_change_no_result() -> None:
    ask = ProtocolRequest(missions=6, seed=3, arms=("direct", "behaviour-tree"), conditions=("nominal",))
    alone, together = rows(ask, SIMULATOR, processes=1, results=None), rows(ask, SIMULATOR, processes=2, results=None)
    assert [_timeless(one) for one in alone] == [_timeless(one) for one in together]


def test_results_are_published_between_the_marks_and_loaded_again(tmp_path: Path) -> None:
    ask = ProtocolRequest(missions=1, seed=3, arms=("direct", GATED), conditions=("nominal", "success-too-soon"))
    judged_rows = rows(ask, SIMULATOR, processes=1, results=None)
    found = evaluation(judged_rows, ask, code=Digest("0" * 64), roles=RoleReport(tested=False), suites=())
    save(found, tmp_path / "evaluation.json")
    assert load(tmp_path / "evaluation.json") == found
    page = with_figures(f"before {BEGIN} old {END} after", found)
    assert page.startswith("before ")
    assert page.endswith(" after")
    assert " old " not in page
    cell = found.cell("direct", "success-too-soon")
    assert cell is not None
    assert cell.command == "regen evaluate --missions 1 --seed 3 --arms direct --faults success-too-soon"
    assert "not tested" in figures(found)
    with pytest.raises(UnknownName):
        load(tmp_path / "nowhere.json")


def test_the_command_prints_rows_that_can_be_made_again() -> None:
    asked = ["evaluate", "--missions", "1", "--seed", "3", "--arms", "direct", "--faults", "nominal", "--json"]
    answer = CliRunner().invoke(app, asked)
    assert answer.exit_code == 0, answer.output
    assert '"command":"regen evaluate --missions 1 --seed 3 --arms direct --faults nominal"' in answer.output.replace(
        '": "', '":"'
    )


def test_an_unknown_arm_is_named_with_the_known_ones() -> None:
    answer = CliRunner().invoke(app, ["evaluate", "--arms", "lucky"])
    assert isinstance(answer.exception, UnknownName)
    assert "evidence-gated" in str(answer.exception)


def _timeless(one: JudgedMission) -> JudgedMission:
    return replace(one, cpu_s=0.0)
