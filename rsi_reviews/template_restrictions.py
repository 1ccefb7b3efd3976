"""Finds what a changed task template would loosen against the accepted one, field by field (D30). Pure.

Places are not bound yet in a template, so its nodes are compared as written: numbers by their direction, other values
for equality.
"""

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

import msgspec

from harness.contracts.effects import Condition
from harness.contracts.reasons import Fact, because
from harness.contracts.tasks import EvidencePolicy, Node, TaskTemplate
from harness.contracts.values import encode
from rsi_reviews.contracts import RestrictionViolation

Tree = Mapping[str, Any]
BUDGET_CEILINGS: dict[str, int] = {
    "re_perceive": 2, "adjust_view": 2, "retry": 1, "local_replan": 2, "switch_skill": 1, "total": 4,
}  # fmt: skip
"""Spends per node; with MISSION_CEILING the outer bound of every recovery (D24)."""
MISSION_CEILING = 8
TIMEOUT_CEILING_S = 600.0
RISKS = ("low", "medium", "high")
LOWER = frozenset({"tolerance_m", "bound", "speed_cap_mps", "pose_age_s", "image_age_s", "within_s"})
HIGHER = frozenset({
    "frames", "width_px", "height_px", "interval_s", "departure_m", "progress", "minimum_confidence", "minimum_charge",
})  # fmt: skip
"""Numbers that only tighten: downwards, upwards. Any other number of a condition stays as it is."""
_ABSENT: Any = None
_LOOKAHEAD_M = (0.2, 1.5)
_DEFAULTS: dict[str, Any] = {
    "depends_on": [], "preconditions": [], "required": True, "risk": "low", "runs_after_failure": False,
    "resources": [], "capabilities": [],
}  # fmt: skip
_POLICY = msgspec.to_builtins(EvidencePolicy(mandatory=()))


def loosened_template(old: TaskTemplate, new: TaskTemplate) -> Iterator[RestrictionViolation]:
    """Refusals for one template, paths from `templates.<name>` on."""
    path = f"templates.{old.name}"
    for field in ("title", "goal", "phrases", "parameters", "serves", "stages", "outcome", "outcomes"):
        was, would = getattr(old, field), getattr(new, field)
        if would != was:
            yield _refusal("text_fixed", f"{path}.{field}", was, would, "text_fixed")
    if new.recovery_total != old.recovery_total and not 0 <= new.recovery_total <= MISSION_CEILING:
        yield _refusal(
            "budget_ceiling", f"{path}.recovery_total", old.recovery_total, new.recovery_total,
            "at_most_spends_per_mission", limit=MISSION_CEILING,
        )  # fmt: skip
    yield from _constraints(f"{path}.constraints", old.constraints, new.constraints)
    yield from _conditions(f"{path}.completion_conditions", old.completion_conditions, new.completion_conditions)
    before, after = _named(old.nodes, "node_id"), _named(new.nodes, "node_id")
    if len(after) != len(new.nodes):
        yield _refusal("stage_twice", f"{path}.nodes", len(old.nodes), len(new.nodes), "stage_twice")
    for name in after.keys() - before.keys():
        yield _refusal("stage_added", f"{path}.nodes.{name}", "", name, "nothing_to_compare_with")
    for name, node in before.items():
        if name not in after:
            yield _refusal("stage_dropped", f"{path}.nodes.{name}", name, "", "stage_dropped")
        else:
            yield from _node(f"{path}.nodes.{name}", node, after[name])


def _node(path: str, old: Tree, new: Tree) -> Iterator[RestrictionViolation]:
    if misshapen := [name for name, value in new.items() if not _shaped(name, value)]:
        for name in misshapen:
            yield _refusal("wrong_type", f"{path}.{name}", old.get(name), new[name], "another_type")
        return
    yield from _unknown_keys(path, new, set(Node.__struct_fields__))
    for field in ("subgoal", "capabilities", "resources", "runs_after_failure"):
        yield from _same(f"{path}.{field}", _of(old, field), _of(new, field))
    if bool(_of(old, "required")) and _of(new, "required") is not True:
        yield _refusal("required_flag", f"{path}.required", True, _of(new, "required"), "required_flag")
    was, would = _of(old, "risk"), _of(new, "risk")
    if would not in RISKS or RISKS.index(would) < RISKS.index(was):
        yield _refusal("risk_class", f"{path}.risk", was, would, "risk_class")
    if missing := [name for name in _of(old, "depends_on") if name not in _of(new, "depends_on")]:
        yield _refusal("dependency", f"{path}.depends_on", missing, "", "dependency")
    timeout_s = new.get("timeout_s")
    was_s = old.get("timeout_s")
    if timeout_s != was_s and not (_number(timeout_s) and 0 < float(str(timeout_s)) <= TIMEOUT_CEILING_S):
        yield _refusal(
            "timeout_ceiling",
            f"{path}.timeout_s",
            was_s,
            timeout_s,
            "at_most_seconds",
            limit_s=TIMEOUT_CEILING_S,
        )
    yield from _budgets(f"{path}.recovery", old.get("recovery", {}), new.get("recovery", {}))
    yield from _parameters(f"{path}.parameters", old.get("parameters", {}), new.get("parameters", {}))
    yield from _evidence(f"{path}.evidence", old.get("evidence", {}), new.get("evidence", {}))
    yield from _preconditions(f"{path}.preconditions", _of(old, "preconditions"), _of(new, "preconditions"))
    yield from _conditions(
        f"{path}.success_conditions", old.get("success_conditions", ()), new.get("success_conditions", ()), risk=was
    )


def _budgets(path: str, old: Tree, new: Tree) -> Iterator[RestrictionViolation]:
    yield from _unknown_keys(path, new, set(BUDGET_CEILINGS))
    for action, ceiling in BUDGET_CEILINGS.items():
        would = new.get(action)
        unchanged = would == old.get(action) and type(would) is int
        if not unchanged and not (type(would) is int and 0 <= would <= ceiling):
            yield _refusal(
                "budget_ceiling",
                f"{path}.{action}",
                old.get(action),
                would,
                "at_most_per_stage",
                limit=ceiling,
            )


def _parameters(path: str, old: Tree, new: Tree) -> Iterator[RestrictionViolation]:
    yield from _unknown_keys(path, new, set(old))
    for name, was in old.items():
        would = new.get(name, _ABSENT)
        if name == "lookahead_m" and _number(was) and _number(would) and _LOOKAHEAD_M[0] <= would <= _LOOKAHEAD_M[1]:
            continue
        yield from _tightened(f"{path}.{name}", name, was, would, rule="parameter")


def _evidence(path: str, old: Tree, new: Tree) -> Iterator[RestrictionViolation]:
    yield from _unknown_keys(path, new, set(EvidencePolicy.__struct_fields__))
    before, after = {**_POLICY, **old}, {**_POLICY, **new}
    if missing := [name for name in before["mandatory"] if name not in after["mandatory"]]:
        yield _refusal("evidence_policy", f"{path}.mandatory", missing, "", "evidence_not_needed")
    if after["attestation"] is not False and before["attestation"] is False:
        yield _refusal("evidence_policy", f"{path}.attestation", False, after["attestation"], "word_for_evidence")
    was, would = before.get("declared", []), after.get("declared", [])
    if not _texts(would) or any(name not in was for name in would):
        yield _refusal("evidence_policy", f"{path}.declared", was, would, "word_for_evidence")
    for name in ("pose_age_s", "image_age_s"):
        yield from _tightened(f"{path}.{name}", name, before[name], after[name], rule="freshness")
    name = "minimum_confidence"
    yield from _tightened(f"{path}.{name}", name, before[name], after[name], rule="confidence")


def _preconditions(path: str, old: Any, new: Any) -> Iterator[RestrictionViolation]:
    for was in old:
        held = [one for one in new if one.get("predicate") == was["predicate"]]
        if not held:
            yield _refusal("precondition_dropped", f"{path}.{was['predicate']}", was, "", "precondition_dropped")
        for would in held:
            for key in was.keys() | would.keys():
                where = f"{path}.{was['predicate']}.{key}"
                yield from _tightened(where, key, was.get(key), would.get(key), rule="precondition")


def _conditions(path: str, old: Any, new: Any, *, risk: str = "") -> Iterator[RestrictionViolation]:
    """Each condition still exists under its name and is as strict; additional conditions only tighten."""
    before, after = _named(old, "condition_id"), _named(new, "condition_id")
    if len(after) != len(new):
        yield _refusal("condition_twice", path, len(old), len(new), "condition_twice")
    for name, was in before.items():
        if name not in after:
            yield _refusal("condition_dropped", f"{path}.{name}", name, "", "condition_dropped")
            continue
        would = after[name]
        yield from _unknown_keys(f"{path}.{name}", would, set(Condition.__struct_fields__))
        yield from _same(f"{path}.{name}.text", was.get("text"), would.get("text"))
        yield from _same(f"{path}.{name}.clause", was.get("clause"), would.get("clause"))
        yield from _same(f"{path}.{name}.fact", was.get("fact", "event"), would.get("fact", "event"))
        yield from _effect(f"{path}.{name}.effect", was.get("effect", {}), would.get("effect", {}))
        yield from _independence(
            f"{path}.{name}.independence", was.get("independence"), would.get("independence"), risk
        )


def _independence(path: str, was: Any, would: Any, risk: str) -> Iterator[RestrictionViolation]:
    if would == was:
        return
    needed = was if was is not None else RISKS.index(risk) if risk in RISKS else len(RISKS)
    if not isinstance(would, int) or would < needed:
        yield _refusal("independence", path, was, would, "independence")


def _effect(path: str, old: Any, new: Any) -> Iterator[RestrictionViolation]:
    if not isinstance(old, Mapping) or not isinstance(new, Mapping):
        yield from _same(path, old, new)
        return
    for key in sorted(old.keys() | new.keys()):
        was, would = old.get(key, _ABSENT), new.get(key, _ABSENT)
        if isinstance(was, Mapping):
            yield from _effect(f"{path}.{key}", was, would)
        else:
            yield from _tightened(f"{path}.{key}", key, was, would, rule="tolerance")


def _constraints(path: str, old: Tree, new: Tree) -> Iterator[RestrictionViolation]:
    if not _texts(new.get("keep_out", [])) or not _texts(new.get("resources", [])):
        yield _refusal("wrong_type", path, old, new, "not_lists_of_names")
        return
    yield from _unknown_keys(path, new, {"speed_cap_mps", "keep_out", "resources", "minimum_charge"})
    for name in ("speed_cap_mps", "minimum_charge"):
        yield from _tightened(f"{path}.{name}", name, old.get(name), new.get(name), rule="constraint")
    if lost := [place for place in old.get("keep_out", []) if place not in new.get("keep_out", [])]:
        yield _refusal("constraint", f"{path}.keep_out", lost, "", "keep_out_lost")
    yield from _same(f"{path}.resources", sorted(old.get("resources", [])), sorted(new.get("resources", [])))


def _tightened(path: str, name: str, was: Any, would: Any, *, rule: str) -> Iterator[RestrictionViolation]:
    """Equal, or a number that moved in its tightening direction."""
    if encode(was) == encode(would):
        return
    if name in LOWER and _number(was) and _number(would):
        if not 0 <= would <= was:
            yield _refusal(rule, path, was, would, "may_only_fall", field=name)
    elif name in HIGHER and _number(was) and _number(would):
        if would < was:
            yield _refusal(rule, path, was, would, "may_only_rise", field=name)
    else:
        yield _refusal(rule, path, was, would, "value_fixed", field=name)


def _same(path: str, was: Any, would: Any) -> Iterator[RestrictionViolation]:
    if encode(was) != encode(would):
        yield _refusal("fixed", path, was, would, "fixed")


def _unknown_keys(path: str, tree: Any, known: set[str]) -> Iterator[RestrictionViolation]:
    for key in sorted(set(tree) - known) if isinstance(tree, Mapping) else ():
        yield _refusal("unknown_key", f"{path}.{key}", "", key, "unknown_key")


def _shaped(name: str, value: Any) -> bool:
    if name in ("parameters", "evidence", "recovery"):
        return isinstance(value, Mapping) and _texts(value.get("mandatory", []))
    if name in ("success_conditions", "preconditions"):
        return isinstance(value, list | tuple) and all(isinstance(one, Mapping) for one in value)
    return name not in ("depends_on", "capabilities", "resources") or _texts(value)


def _texts(value: Any) -> bool:
    return isinstance(value, list | tuple) and all(isinstance(one, str) for one in value)


def _named(trees: Any, key: str) -> dict[str, Tree]:
    return {str(tree.get(key)): tree for tree in trees}


def _of(node: Tree, field: str) -> Any:
    return node.get(field, _DEFAULTS.get(field))


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _refusal(rule: str, path: str, old: Any, new: Any, code: str, **facts: Fact) -> RestrictionViolation:
    return RestrictionViolation(
        rule=rule, path=path, old=display_value(old), new=display_value(new), reason=because(code, **facts)
    )


def display_value(value: Any) -> str:
    """A value as canonical JSON, texts as they are, null for one that is not set; at most 200 characters."""
    text = value if isinstance(value, str) else encode(None if value is msgspec.UNSET else value).decode()
    return text if len(text) <= 200 else f"{text[:197]}..."
