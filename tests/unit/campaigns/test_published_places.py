"""What a campaign publishes: each lie keeps its newest run at a place, with the command and the code that made it."""

from pathlib import Path

import msgspec

from experiments.campaigns.code import code_digest
from experiments.campaigns.fuzz_page import BEGIN as FUZZ_BEGIN
from experiments.campaigns.fuzz_page import END as FUZZ_END
from experiments.campaigns.fuzz_page import FuzzRun
from experiments.campaigns.fuzz_page import publish as publish_fuzz
from experiments.campaigns.hostile import BEGIN, END, HostileResults, KitRun, LooksResult, SecondLooks, publish
from experiments.campaigns.recovery_steps import BEGIN as STEPS_BEGIN
from experiments.campaigns.recovery_steps import END as STEPS_END
from experiments.campaigns.recovery_steps import StepReport
from experiments.campaigns.recovery_steps import publish as publish_steps
from harness.conformance.hostile.kit import counted
from harness.conformance.hostile.missions import MissionUnderLie


def mission(mode: str, *, ended: str = "awaiting_human") -> MissionUnderLie:
    return MissionUnderLie(
        mode=mode, group="sensors", text=mode, ended=ended, why="", committed=(), completed=False,
        false_completion=False, epistemic=False, untrue="", against_truth=True, motions=1, second_motions=0,
        hang=False, traceback="", held=(), wall_s=1.0, peak_mib=200,
    )  # fmt: skip


def run(code: str, *modes: str, ended: str = "awaiting_human", peak_mib: int = 200) -> KitRun:
    report = counted([mission(mode, ended=ended) for mode in modes], peak_mib=peak_mib)
    return KitRun(command=f"try {code}", code=code * 64, report=report)


def published(tmp_path: Path, *made: HostileResults) -> str:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nformer table\n{END}\nafter\n")
    for one in made:
        publish(one, page=page, results=tmp_path / "hostile.json")
    return page.read_text()


def test_a_place_that_was_not_tried_again_keeps_its_run_with_its_command_and_its_code(tmp_path: Path) -> None:
    first = HostileResults(looks=LooksResult(command="look", code="a" * 64, looks=SecondLooks(2, 20, 0)))
    first = first.with_run("address", run("a", "poses-held", "poses-stale")).with_run("process", run("a", "poses-held"))
    text = published(tmp_path, first, HostileResults().with_run("process", run("b", "poses-held")))
    assert "| missions, each under one lie | 1 | 2 |" in text
    assert "| one process: `try b` | 1 | `bbbbbbbbbbbb` |" in text and "one process: `try a`" not in text
    assert "| a simulator at an address: `try a` | 2 | `aaaaaaaaaaaa` |" in text
    assert "Of 2 honest missions in one log, with 20 images of one place, 0 had an image taken for a copy." in text
    assert text.startswith("before\n") and text.endswith("after\n") and "former" not in text


def test_lies_that_were_played_in_parts_stand_together_each_with_the_code_it_met(tmp_path: Path) -> None:
    first = HostileResults().with_run("address", run("a", "poses-held", "poses-stale", peak_mib=300))
    second = HostileResults().with_run("address", run("b", "poses-stale", "odometry-held", ended="succeeded"))
    text = published(tmp_path, first, second)
    assert "| missions, each under one lie | 3 |" in text and "| 300 MiB |" in text
    assert "| a simulator at an address: `try a` | 1 | `aaaaaaaaaaaa` |" in text
    assert "| a simulator at an address: `try b` | 2 | `bbbbbbbbbbbb` |" in text
    kept = msgspec.json.decode((tmp_path / "hostile.json").read_bytes(), type=HostileResults)
    ended = {one.mode: one.ended for one in kept.places["address"].report.met}
    assert ended == {"poses-held": "awaiting_human", "odometry-held": "succeeded", "poses-stale": "succeeded"}


def test_a_lie_that_left_the_kit_is_not_published_any_more(tmp_path: Path) -> None:
    first = HostileResults().with_run("address", run("a", "flattery", "poses-held"))
    text = published(tmp_path, first, HostileResults().with_run("address", run("b", "poses-stale")))
    assert "| missions, each under one lie | 2 |" in text and "flattery" not in text


def test_the_recovery_table_names_the_code_and_how_often_each_fault_was_played(tmp_path: Path) -> None:
    page = tmp_path / "recovery.md"
    page.write_text(f"{STEPS_BEGIN}\n{STEPS_END}\n")
    report = StepReport(missions=42, rounds=2, seed=1, steps=(), offences=())
    publish_steps(report, command="try it", code="c" * 64, page=page)
    assert "42 missions with a fault each, 2 of each fault with each template" in page.read_text()
    assert "Made by `try it` on code `cccccccccccc`." in page.read_text()


def test_the_code_of_a_campaign_is_another_with_the_sources_of_another_folder() -> None:
    assert code_digest() == code_digest() != code_digest("experiments/verifier")


def fuzzed(seed: int, *, tried: int, code: str = "a") -> FuzzRun:
    return FuzzRun(seed=seed, seconds=120.0, code=code * 64, tried=tried, read=1, refused=tried - 1, limited=0)


def test_runs_of_a_parser_with_other_seeds_add_up_and_the_same_seed_counts_once(tmp_path: Path) -> None:
    page, results = tmp_path / "page.md", tmp_path / "fuzz.json"
    page.write_text(f"before\n{FUZZ_BEGIN}\n{FUZZ_END}\nafter\n")
    for runs in (
        {"pcd": fuzzed(1, tried=900)},
        {"pcd": fuzzed(1, tried=1000)},
        {"pcd": fuzzed(2, tried=500, code="b")},
    ):
        publish_fuzz(runs, page=page, results=results)
    assert "| pcd | 4.0 | 1,500 | 2 | 1,498 | 0 | 0 | 1, 2 | `aaaaaaaaaaaa` `bbbbbbbbbbbb` |" in page.read_text()
    assert page.read_text().startswith("before\n") and page.read_text().endswith("after\n")
