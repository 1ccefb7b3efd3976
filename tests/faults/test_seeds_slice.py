"""A slice of the campaign over seeds: the shipped missions succeed without a fault, and what fails is named."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from experiments.campaigns.seeds import BEGIN, END, ENDS, SeedResult, all_seeds, one_seed, publish, report, wrong_with
from harness.projections.mission import Mission
from tests.builders.connections import staged


def test_a_few_seeds_of_every_shipped_mission_end_as_they_should(tmp_path: Path) -> None:
    results = list(all_seeds(ENDS, seed=5, missions=1, processes=1, minutes=None))
    found = report(results, seed=5, missions=1, command="python -m experiments.campaigns seeds --missions 1 --seed 5")
    assert found.offences == ()
    assert {one.template: (one.passed, one.least >= 1) for one in found.templates} == dict.fromkeys(ENDS, (1, True))
    page, json = tmp_path / "page.md", tmp_path / "seeds.json"
    page.write_text(f"Before.\n{BEGIN}\nold\n{END}\nAfter.\n", encoding="utf-8")
    publish(found, page=page, results=json)
    text = page.read_text(encoding="utf-8")
    assert "| circuit | succeeded | 1 | 1 |" in text and "old" not in text and text.endswith("After.\n")


@pytest.mark.parametrize("seed", [25, 58, 111])
def test_an_exploration_goes_on_while_a_place_is_left_that_sees_the_rest(seed: int) -> None:
    """Seeds on which the only edges left lay outside the zones; they ended at 94 % of the floor."""
    assert one_seed("exploration", seed).wrong == ()


def judged() -> Mission:
    with staged() as stage:
        return stage.run(stage.begin("circuit")).mission


def test_what_is_wrong_with_an_end_is_named() -> None:
    mission = judged()
    assert mission.goal_verdict is not None
    assert list(wrong_with(mission, expected="succeeded")) == []
    first, *others = mission.goal_verdict.results
    low = replace(mission.goal_verdict, results=(replace(first, independence=0), *others))
    (said,) = wrong_with(replace(mission, goal_verdict=low), expected="succeeded")
    assert said == f"{first.condition_id} rests on independence 0"
    assert list(wrong_with(replace(mission, goal_verdict=None), expected="succeeded")) == ["the goal was never judged"]
    assert any("ended succeeded" in one for one in wrong_with(mission, expected="partly_verified"))
    doubted = replace(mission.goal_verdict, results=(replace(first, verdict="ambiguous"), *others))
    assert list(wrong_with(replace(mission, goal_verdict=doubted), expected="succeeded")) != []


def test_a_seed_that_fails_is_an_offence_with_its_number() -> None:
    failed = SeedResult(template="circuit", seed=7, status="failed", wrong=("ended failed: so",), failures=1, least=1)
    found = report([failed], seed=7, missions=1, command="so")
    assert found.offences == ("circuit, seed 7: ended failed: so",)
