"""What is kept of a fleet, and what is said of all of them: rows, answers, contrasts, plots, the published page."""

from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.errors import ContractInvalid
from harness.contracts.values import digest, encode
from rsi_reviews.hidden_sites import site_file
from rsi_reviews.recursion.arms import ARMS, Arm
from rsi_reviews.recursion.experiment import MEASURED, ArmMeasurement, CandidateStep, FleetOutcome, Task, Terms
from rsi_reviews.recursion.gating import GateJudgement
from rsi_reviews.recursion.plots import plot
from rsi_reviews.recursion.publish import BEGIN, END, found, publish
from rsi_reviews.recursion.report import answers, contrasts, rows
from rsi_reviews.recursion.run import outcomes, read_outcomes, tasks
from simulator.in_process import SIMULATOR
from tests.saying import raises_saying

H0 = baseline()


def measured(arm: Arm, generation: int, **sums: float) -> ArmMeasurement:
    values = {**dict.fromkeys(MEASURED, 0.0), "verified_completion": 10.0, "verified_s": 400.0, "unsound": 0.0, **sums}
    return ArmMeasurement(arm=arm, generation=generation, missions=10, sums=values, configuration=H0.configuration_id)


def outcome(fleet: int, *, kind: str = "regular", cost: dict[Arm, float] | None = None, released: bool = False,
            false: float = 0.0) -> FleetOutcome:  # fmt: skip
    costs: dict[Arm, float] = dict.fromkeys(ARMS, 40.0) | (cost or {})
    judgement = GateJudgement(
        candidate="c", component="recovery", reason="r", metric="recovery_cost", accepted=released,
        clause="accepted" if released else "unexercised", sentence="s", missions=10,
    )  # fmt: skip
    return FleetOutcome(
        task=Task(terms=Terms(seed=1, generations=1), fleet=fleet, site="calm"), kind=kind, simulated=100,
        measured=tuple(
            measured(arm, generation, recovery_cost=costs[arm] + fleet % 3 if generation else 40.0,
                     contract_false_completion=false if arm == "gated" else 0.0)
            for arm in ARMS for generation in (0, 1)
        ),
        steps=(CandidateStep(arm="gated", generation=0, judgement=judgement),),
    )  # fmt: skip


BETTER: dict[Arm, float] = {"gated": 5.0, "expert": 4.0}


@pytest.mark.ledger("R169", symbol="rsi_reviews.recursion.report:rows")
def test_rows_hold_the_measures_of_the_paper_per_arm_and_generation() -> None:
    found_rows = rows([outcome(n, cost=BETTER, released=True) for n in range(1, 7)])
    assert [(row["arm"], row["generation"]) for row in found_rows] == [(arm, g) for arm in ARMS for g in (0, 1)]
    gated = next(row for row in found_rows if (row["arm"], row["generation"]) == ("gated", 1))
    assert gated["n"] == 60 and gated["fleets"] == 6 and gated["verified_completion"] == 1.0
    assert gated["recovery_cost"] == pytest.approx(0.6)
    low, high = gated["recovery_cost_ci"]
    assert low < 0.6 < high
    assert gated["false_completion"] == 0.0 and gated["false_completion_ci"] == [0.0, 0.0]
    assert (gated["proposed"], gated["accepted"], gated["gate_missions_per_release"]) == (6, 6, 10.0)
    assert gated["verified_mission_s"] == 40.0


def test_a_gain_beyond_its_interval_is_not_refuted_and_a_tie_is() -> None:
    better = {one.refutes: one.refuted for one in answers([outcome(n, cost=BETTER) for n in range(1, 9)])}
    assert not better["the gated loop does not improve on the frozen harness"]
    tie = {one.refutes: one.refuted for one in answers([outcome(n) for n in range(1, 9)])}
    assert tie["the gated loop does not improve on the frozen harness"]
    assert tie["the gated loop does not beat batch tuning: no value in recursion"]


def test_a_release_where_nothing_recurs_and_a_false_completion_refute() -> None:
    calm = [outcome(n, kind="none", released=n == 1) for n in range(1, 4)]
    by_claim = {one.refutes: one for one in answers(calm)}
    assert by_claim["worlds without regularities release more often than alpha"].refuted
    assert "1 of 9" in by_claim["worlds without regularities release more often than alpha"].sentence
    false = {one.refutes: one.refuted for one in answers([outcome(1, false=1.0)])}
    assert false["the gated loop makes contract false completions"]
    assert false["worlds without regularities release more often than alpha"] is None


def test_contrasts_are_paired_by_fleet_and_signed_so_that_more_is_better() -> None:
    costs = contrasts([outcome(n, cost=BETTER) for n in range(1, 9)])
    against = {one.against: one for one in costs if (one.measure, one.over) == ("recovery_cost", "last")}
    assert against["frozen"].gain == pytest.approx(3.5) and against["frozen"].low == pytest.approx(3.5)
    assert against["expert"].gain == pytest.approx(-0.1)


def test_a_fleet_that_was_finished_is_not_run_again_and_one_of_other_terms_is_not_taken(tmp_path: Path) -> None:
    wanted = [outcome(n).task for n in (1, 2)]
    for n in (1, 2):
        one = outcome(n)
        (tmp_path / f"fleet-{n}-{digest(one.task)[:12]}.json").write_bytes(encode(one))
    told: list[int] = []
    found_again = outcomes(
        wanted, simulator=SIMULATOR, folder=tmp_path, processes=1, report=lambda one, done, of: told.append(done)
    )
    assert [one.task.fleet for one in found_again] == [1, 2] and told == []
    other = [replace(task, terms=replace(task.terms, seed=2)) for task in wanted]
    assert read_outcomes(other, folder=tmp_path) == ()


def test_ten_fleets_are_one_turn_of_the_sites() -> None:
    turn = [site_file(task.site).kind for task in tasks(Terms(seed=1), 30)]
    assert (turn.count("regular"), turn.count("none"), turn.count("drifting")) == (21, 6, 3)


def test_a_plot_names_every_arm_and_says_its_figures_in_words() -> None:
    found_rows = rows([outcome(n, cost=BETTER) for n in range(1, 4)])
    svg = plot(found_rows, measure="recovery_cost", title="Cost", unit="per mission")
    tree = ElementTree.fromstring(svg)
    texts = [one.text or "" for one in tree.iter("{http://www.w3.org/2000/svg}text")]
    assert set(ARMS) <= set(texts) and "generation" in texts
    assert "gated: 4 at generation 0" in (tree.findtext("{http://www.w3.org/2000/svg}desc") or "")
    assert "prefers-color-scheme:dark" in svg


def test_a_published_run_stands_in_the_page_in_json_and_in_plots(tmp_path: Path) -> None:
    (tmp_path / "recursion.md").write_text(f"# Before\n\n{BEGIN}\nold\n{END}\n\n# After\n")
    done = [outcome(n, cost=BETTER) for n in range(1, 4)]
    publish(found(done, (), Terms(seed=1, generations=1), fleets=3), docs=tmp_path)
    page = (tmp_path / "recursion.md").read_text()
    assert page.startswith("# Before") and page.rstrip().endswith("# After") and "old" not in page
    assert "| gated | 30 |" in page and "3 of 3 fleets" in page
    stored = msgspec.json.decode((tmp_path / "results" / "recursion.json").read_bytes())
    assert {row["arm"] for row in stored["rows"]} == set(ARMS) and stored["complete"]
    assert (tmp_path / "recursion" / "recovery-cost.svg").exists()
    (tmp_path / "recursion.md").write_text("# no place\n")
    with raises_saying(ContractInvalid, match="no place for figures"):
        publish(found(done, (), Terms(seed=1), fleets=3), docs=tmp_path)
