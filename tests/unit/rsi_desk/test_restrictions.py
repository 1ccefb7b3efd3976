"""What a candidate may not loosen: each thing that D30 names, refused by its rule before anything runs."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from rsi_reviews.restrictions import loosened
from tests.builders.releases import tried

Tree = dict[str, Any]
Edit = Callable[[Tree], object]


def edited(edit: Edit) -> Configuration:
    """The baseline after an edit of its JSON tree."""
    tree: Tree = msgspec.json.decode(msgspec.json.encode(baseline()))
    edit(tree)
    return msgspec.convert(tree, Configuration, strict=True)


def rules(configuration: Configuration) -> list[str]:
    return [refusal.rule for refusal in loosened(baseline(), configuration)]


def circuit(tree: Tree) -> Tree:
    return next(template for template in tree["templates"] if template["name"] == "circuit")


def stage(tree: Tree, name: str = "circuit") -> Tree:
    return next(node for node in circuit(tree)["nodes"] if node["node_id"] == name)


def condition(tree: Tree, number: int = 0) -> Tree:
    return stage(tree)["success_conditions"][number]


def ladders(tree: Tree) -> Tree:
    found: Tree = tree["recovery"]["ladders"]
    return found


LOOSENINGS: dict[str, tuple[Edit, str]] = {
    "drops a success condition": (lambda t: stage(t)["success_conditions"].pop(), "condition_dropped"),
    "drops a completion condition": (lambda t: circuit(t)["completion_conditions"].pop(), "condition_dropped"),
    "drops a stage": (lambda t: circuit(t)["nodes"].pop(0), "stage_dropped"),
    "drops a template": (lambda t: t["templates"].pop(0), "template_dropped"),
    "adds a template": (lambda t: t["templates"].append({**circuit(t), "name": "lax"}), "template_added"),
    "widens the arrival radius": (lambda t: condition(t)["effect"].update(tolerance_m=0.8), "tolerance"),
    "lets the body drift": (lambda t: condition(t, 1)["effect"].update(bound=0.5), "tolerance"),
    "tests a shorter interval": (lambda t: condition(t, 1)["effect"].update(interval_s=0.1), "tolerance"),
    "asks for less of the route": (lambda t: condition(t)["effect"]["bounds"].update(progress=0.5), "tolerance"),
    "names another predicate": (lambda t: condition(t)["effect"].update(predicate="arrival"), "tolerance"),
    "makes an event of a state": (lambda t: condition(t).update(fact="state"), "fixed"),
    "needs fewer sources": (lambda t: condition(t).update(independence=0), "independence"),
    "makes a stage optional": (lambda t: stage(t).update(required=False), "required_flag"),
    "rates the risk lower": (lambda t: stage(t).update(risk="low"), "risk_class"),
    "starts before its dependency": (lambda t: stage(t).update(depends_on=[]), "dependency"),
    "drops a precondition": (lambda t: stage(t)["preconditions"].pop(), "precondition_dropped"),
    "needs no trajectory": (lambda t: stage(t)["evidence"].update(mandatory=[]), "evidence_policy"),
    "lets a word stand for evidence": (lambda t: stage(t)["evidence"].update(attestation=True), "evidence_policy"),
    "takes older poses in a stage": (lambda t: stage(t)["evidence"].update(pose_age_s=5.0), "freshness"),
    "takes doubtful records in a stage": (lambda t: stage(t)["evidence"].update(minimum_confidence=0.1), "confidence"),
    "raises a retry above its ceiling": (lambda t: stage(t)["recovery"].update(retry=2), "budget_ceiling"),
    "raises the total above its ceiling": (lambda t: stage(t)["recovery"].update(total=5), "budget_ceiling"),
    "raises the mission's budget": (lambda t: circuit(t).update(recovery_total=9), "budget_ceiling"),
    "drives faster": (lambda t: stage(t)["parameters"].update(speed_cap_mps=0.9), "parameter"),
    "aims wider": (lambda t: stage(t)["parameters"].update(tolerance_m=0.9), "parameter"),
    "raises the speed limit": (lambda t: circuit(t)["constraints"].update(speed_cap_mps=1.5), "constraint"),
    "starts with an empty battery": (lambda t: circuit(t)["constraints"].update(minimum_charge=0.0), "constraint"),
    "waits for ever": (lambda t: stage(t).update(timeout_s=1e9), "timeout_ceiling"),
    "tells people another goal": (lambda t: circuit(t).update(phrases=["inspect the storage area"]), "text_fixed"),
    "adds a key to a stage": (lambda t: stage(t).update(gate="off"), "unknown_key"),
    "gives a stage a list of budgets": (lambda t: stage(t).update(recovery=[1, 2]), "wrong_type"),
    "shows the verifier less": (lambda t: t["context_rules"].update(c3_items=2), "c3_rule"),
    "shows the verifier more": (lambda t: t["context_rules"].update(c3_items=30), "c3_rule"),
    "counts doubtful records": (lambda t: t["context_rules"].update(minimum_confidence=0.2), "confidence"),
    "counts old poses as fresh": (lambda t: t["context_rules"].update(pose_age_s=2.0), "freshness"),
    "counts old images as fresh": (lambda t: t["context_rules"].update(image_age_s=60.0), "freshness"),
    "shows the planner everything": (lambda t: t["context_rules"].update(c1_items=500), "budget_ceiling"),
    "spends more without a person": (lambda t: t["recovery"].update(approval_share=1.0), "approval_requirement"),
    "waits an hour": (lambda t: t["recovery"].update(wait_s=3600.0), "wait_bounds"),
    "goes on when unsafe": (lambda t: ladders(t).update(unsafe_action=["retry", "human"]), "safety_interlock"),
    "sends again blindly": (lambda t: ladders(t).update(outcome_unknown=["retry", "human"]), "safety_interlock"),
    "does not stop on a timeout": (lambda t: ladders(t).update(timeout=["human"]), "safety_interlock"),
    "asks nobody": (lambda t: ladders(t).update(violated=["re_perceive"]), "ladder_end"),
    "has no ladder": (lambda t: ladders(t).pop("violated"), "ladder_end"),
    "spends after a switch": (
        lambda t: ladders(t).update(violated=["switch_skill", "retry", "human"]), "ladder_order"
    ),
    "waits longer": (lambda t: t["recovery"].update(wait_s=21.0), "asks_later"),
    "waits seven times": (
        lambda t: ladders(t).update(precondition_unmet=["wait"] * 7 + ["human"]), "asks_later"
    ),
    "waits before it looks": (lambda t: ladders(t).update(violated=["wait", "re_perceive", "human"]), "asks_later"),
    "drowns the other terms": (lambda t: t["routing"].update(cost=1e6), "weight_bounds"),
}  # fmt: skip


@pytest.mark.ledger("R152", "R162", symbol="rsi_reviews.restrictions:loosened")
@pytest.mark.parametrize("name", LOOSENINGS)
def test_a_loosening_is_refused_by_its_rule(name: str) -> None:
    edit, rule = LOOSENINGS[name]
    assert rule in rules(edited(edit))


TIGHTENINGS: dict[str, Edit] = {
    "a smaller radius": lambda t: condition(t)["effect"].update(tolerance_m=0.3),
    "a longer interval": lambda t: condition(t, 1)["effect"].update(interval_s=2.0),
    "more of the route": lambda t: condition(t)["effect"]["bounds"].update(progress=0.99),
    "a further condition": lambda t: stage(t)["success_conditions"].append(
        {**condition(t, 1), "condition_id": "circuit.still"}
    ),
    "more independent sources": lambda t: condition(t).update(independence=2),
    "a higher risk": lambda t: stage(t).update(risk="high"),
    "fewer retries": lambda t: stage(t)["recovery"].update(retry=0),
    "a smaller mission budget": lambda t: circuit(t).update(recovery_total=5),
    "a shorter timeout": lambda t: stage(t).update(timeout_s=90.0),
    "a longer timeout below the ceiling": lambda t: stage(t).update(timeout_s=240.0),
    "slower driving": lambda t: stage(t)["parameters"].update(speed_cap_mps=0.3),
    "another look-ahead": lambda t: stage(t)["parameters"].update(lookahead_m=0.9),
    "templates in another order": lambda t: t["templates"].reverse(),
    "fresher poses": lambda t: t["context_rules"].update(pose_age_s=0.5),
    "a larger planner's context": lambda t: t["context_rules"].update(c1_items=30),
    "other weights": lambda t: t["routing"].update(history=2.0),
    "less without a person": lambda t: t["recovery"].update(approval_share=0.25),
    "shorter waits": lambda t: t["recovery"].update(wait_s=10.0),
    "two waits of half the time": lambda t: (
        t["recovery"].update(wait_s=10.0),
        t["recovery"]["ladders"].update(precondition_unmet=["wait", "wait", "human"]),
    ),
    "a second wait for a step that frees nothing": lambda t: t["recovery"]["ladders"].update(
        resource_conflict=["wait", "wait", "human"]
    ),
    "another ladder": lambda t: t["recovery"]["ladders"].update(ambiguous=["adjust_view", "re_perceive", "human"]),
}


@pytest.mark.parametrize("name", TIGHTENINGS)
def test_what_keeps_or_tightens_passes(name: str) -> None:
    changed = edited(TIGHTENINGS[name])
    assert changed != baseline()
    assert rules(changed) == []


def test_a_refusal_names_path_old_and_new_value() -> None:
    found = loosened(baseline(), edited(LOOSENINGS["widens the arrival radius"][0]))
    assert [(one.path, one.old, one.new) for one in found] == [
        ("templates.circuit.nodes.circuit.success_conditions.circuit.closed.effect.tolerance_m", "0.4", "0.8")
    ]


def test_every_loosening_is_listed_not_only_the_first() -> None:
    def twice(tree: Tree) -> None:
        LOOSENINGS["widens the arrival radius"][0](tree)
        LOOSENINGS["counts old poses as fresh"][0](tree)

    assert rules(edited(twice)) == ["freshness", "tolerance"]


def test_the_outer_bound_does_not_move_with_the_baseline() -> None:
    """A budget that one release lowered may rise again, but never above the ceiling that no release can move."""
    lowered = edited(lambda t: stage(t)["recovery"].update(retry=0))
    raised = edited(lambda t: stage(t)["recovery"].update(retry=2))
    assert [one.rule for one in loosened(lowered, baseline())] == []
    assert [one.rule for one in loosened(lowered, raised)] == ["budget_ceiling"]


def test_waits_that_postpone_the_question_are_refused_with_both_times() -> None:
    """Seven waits of 120 s: a person would be asked after 840 s, the baseline asks after 20 s."""

    def seven(tree: Tree) -> None:
        tree["recovery"].update(wait_s=120.0)
        ladders(tree).update(precondition_unmet=["wait"] * 7 + ["human"])

    found = [one for one in loosened(baseline(), edited(seven)) if one.path.endswith("precondition_unmet")]
    assert [one.rule for one in found] == ["asks_later"]
    assert found[0].reason.facts == {"was_s": 20.0, "would_s": 840.0, "failure": "precondition_unmet"}


def test_the_same_configuration_loosens_nothing() -> None:
    assert loosened(baseline(), replace(baseline())) == ()
    assert loosened(baseline(), tried()) == ()
