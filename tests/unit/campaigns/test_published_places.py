"""What a campaign publishes: each place keeps its newest run, with the command and the code that made it."""

from pathlib import Path

import msgspec

from experiments.campaigns.code import code_digest
from experiments.campaigns.hostile import BEGIN, END, HostileResults, LooksResult, PlaceResult, SecondLooks, publish
from experiments.campaigns.recovery_steps import BEGIN as STEPS_BEGIN
from experiments.campaigns.recovery_steps import END as STEPS_END
from experiments.campaigns.recovery_steps import StepReport
from experiments.campaigns.recovery_steps import publish as publish_steps
from harness.conformance.hostile.kit import LieReport


def result(code: str, *, missions: int) -> PlaceResult:
    report = LieReport(
        missions=missions, completions=0, false_completions=0, epistemic=0, second_motions=0, hangs=0, tracebacks=0,
        held=0, against_truth=missions, peak_mib=200, undetectable=("every-source-forged",), met=(),
    )  # fmt: skip
    return PlaceResult(command=f"try {code}", code=code * 64, report=report)


def test_a_place_that_was_not_tried_again_keeps_its_run_with_its_command_and_its_code(tmp_path: Path) -> None:
    page, results = tmp_path / "page.md", tmp_path / "hostile.json"
    page.write_text(f"before\n{BEGIN}\nformer table\n{END}\nafter\n")
    first = HostileResults(looks=LooksResult(command="look", code="a" * 64, looks=SecondLooks(2, 20, 0)))
    first = first.with_place("address", result("a", missions=9)).with_place("process", result("a", missions=7))
    publish(first, page=page, results=results)
    publish(HostileResults().with_place("process", result("b", missions=8)), page=page, results=results)
    text = page.read_text()
    assert "| missions, each under one lie | 8 | 9 |" in text
    assert "| one process: `try b` | `bbbbbbbbbbbb` |" in text
    assert "| a simulator at an address: `try a` | `aaaaaaaaaaaa` |" in text
    assert "Of 2 honest missions in one log, with 20 images of one place, 0 had an image taken for a copy." in text
    assert text.startswith("before\n") and text.endswith("after\n") and "former" not in text
    kept = msgspec.json.decode(results.read_bytes(), type=HostileResults)
    assert {name: one.report.missions for name, one in kept.places.items()} == {"process": 8, "address": 9}


def test_the_recovery_table_names_the_code_and_how_often_each_fault_was_played(tmp_path: Path) -> None:
    page = tmp_path / "recovery.md"
    page.write_text(f"{STEPS_BEGIN}\n{STEPS_END}\n")
    report = StepReport(missions=42, rounds=2, seed=1, steps=(), offences=())
    publish_steps(report, command="try it", code="c" * 64, page=page)
    assert "42 missions with a fault each, 2 of each fault with each template" in page.read_text()
    assert "Made by `try it` on code `cccccccccccc`." in page.read_text()


def test_the_code_of_a_campaign_is_another_with_the_sources_of_another_folder() -> None:
    assert code_digest() == code_digest() != code_digest("experiments/verifier")
