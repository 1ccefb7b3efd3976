"""Candidates that could not run: refused at proposal with a typed reason, before anything is measured."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from app.i18n.reasons.rendering import sentence
from harness.baseline.load import baseline, earlier, shipped_workspace
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Refused
from harness.contracts.values import Moment
from rsi_reviews.commands import ProposeCandidate
from rsi_reviews.projections import Review
from rsi_reviews.proposal_rules import propose
from rsi_reviews.runnable import unrunnable
from tests.builders.releases import LAUNCHER, candidate, tried

Tree = dict[str, Any]
Edit = Callable[[Tree], object]


def edited(edit: Edit) -> Configuration:
    tree: Tree = msgspec.json.decode(msgspec.json.encode(baseline()))
    edit(tree)
    return msgspec.convert(tree, Configuration, strict=True)


def template(tree: Tree, name: str = "circuit") -> Tree:
    return next(one for one in tree["templates"] if one["name"] == name)


def stage(tree: Tree, name: str, of: str = "circuit") -> Tree:
    return next(node for node in template(tree, of)["nodes"] if node["node_id"] == name)


def further_condition(**effect: Any) -> Tree:
    return {"condition_id": "circuit.further", "text": "Something more", "effect": effect}


UNRUNNABLE: dict[str, tuple[Edit, str]] = {
    "stages that wait for each other": (
        lambda t: stage(t, "request").update(depends_on=["circuit"]), "graph_cycle"
    ),
    "a stage that waits for itself": (lambda t: stage(t, "circuit")["depends_on"].append("circuit"), "graph_cycle"),
    "a dependency on no stage": (lambda t: stage(t, "circuit")["depends_on"].append("dance"), "dependency_unknown"),
    "a further condition without its numbers": (
        lambda t: stage(t, "circuit")["success_conditions"].append(
            further_condition(type="metric", predicate="arrival")
        ),
        "template_invalid",
    ),
    "a further condition of another type": (
        lambda t: stage(t, "circuit")["success_conditions"].append(further_condition(type="magic", predicate="x")),
        "template_invalid",
    ),
    "a further condition that nobody can test": (
        lambda t: stage(t, "circuit")["success_conditions"].append(
            further_condition(type="symbolic", predicate="is_happy", arguments={})
        ),
        "verifier_missing",
    ),
    "a further condition without a stage that leaves its evidence": (
        lambda t: stage(t, "circuit")["success_conditions"].append(
            further_condition(type="visual", predicate="panorama", frames=8, width_px=1280, height_px=720)
        ),
        "evidence_unmade",
    ),
    "a placeholder that nothing binds": (
        lambda t: stage(t, "circuit")["success_conditions"].append(
            further_condition(
                type="metric", predicate="arrival", frame="${moon.frame}", map_version="m", target_m=[0, 0],
                tolerance_m=0.1,
            )
        ),
        "spot_unbound",
    ),
    "a further precondition of another word": (
        lambda t: stage(t, "circuit")["preconditions"].append({"predicate": "in_the_mood"}), "value_not_listed"
    ),
    "evidence that no packet holds": (
        lambda t: stage(t, "circuit")["evidence"]["mandatory"].append("unicorn"), "unknown_evidence"
    ),
    "counters without a total": (lambda t: stage(t, "circuit")["recovery"].update(total=0), "zero_budget"),
    "a mission that may spend nothing": (lambda t: template(t).update(recovery_total=0), "zero_budget"),
    "a planner that is shown nothing": (lambda t: t["context_rules"].update(c1_items=0), "context_too_small"),
    "a skill that is shown nothing": (lambda t: t["context_rules"].update(c2_items=0), "context_too_small"),
    "a recovery that is shown one record": (lambda t: t["context_rules"].update(c4_items=1), "context_too_small"),
    "a step more often than anything pays for": (
        lambda t: t["recovery"]["ladders"].update(interrupted=["retry", "retry", "human"]), "ladder_cycle"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", UNRUNNABLE)
def test_a_candidate_that_cannot_run_is_refused_with_a_typed_reason(name: str) -> None:
    edit, rule = UNRUNNABLE[name]
    found = unrunnable(baseline(), edited(edit))
    assert rule in [one.rule for one in found]
    assert all(one.reason.code and one.path for one in found)


def test_a_wrong_value_in_a_template_is_answered_with_its_path_and_the_list() -> None:
    edit, rule = UNRUNNABLE["a further precondition of another word"]
    (found,) = [one for one in unrunnable(baseline(), edited(edit)) if one.rule == rule]
    assert found.path == "templates.circuit.nodes.circuit.preconditions[2].predicate"
    assert "is none of at_place, hardware_stop_released, localised, static" in sentence(found.reason)


@pytest.mark.parametrize("name", UNRUNNABLE)
def test_the_proposal_itself_is_refused(name: str) -> None:
    edit, _ = UNRUNNABLE[name]
    made = candidate(edited(edit))
    command = ProposeCandidate(candidate=made, baseline=baseline(), actor=LAUNCHER, reason="try it", key="k")
    assert isinstance(propose(Review(), command, Moment(mission_s=0.0, wall_s=0.0)), Refused)


def test_what_ships_runs() -> None:
    with_all = msgspec.structs.replace(baseline(), templates=(*baseline().templates, *shipped_workspace().missions))
    empty = msgspec.structs.replace(baseline(), templates=())
    assert unrunnable(empty, with_all) == ()


@pytest.mark.parametrize("one", earlier(), ids=lambda one: one.configuration_id[:8])
def test_a_candidate_of_a_site_that_still_runs_an_earlier_release_is_not_held_to_what_that_one_lacks(
    one: Configuration,
) -> None:
    waits = msgspec.structs.replace(one.recovery, wait_s=10.0)
    assert unrunnable(one, msgspec.structs.replace(one, recovery=waits)) == ()


def test_a_plain_candidate_runs() -> None:
    assert unrunnable(baseline(), tried()) == ()


def test_a_flaw_that_the_baseline_has_too_is_not_held_against_a_candidate() -> None:
    broken = edited(lambda t: template(t).update(recovery_total=0))
    assert unrunnable(broken, broken) == ()
