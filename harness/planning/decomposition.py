"""Decomposes a goal into stages, and checks the plan of whichever planner proposed them (R225). Pure.

A template offers stages with their conditions and limits. A planner, a model included, chooses and orders them: it
can add an order, never a stage, a capability or a condition, and it cannot leave out what the goal requires.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec

from harness.contracts.decisions import Refused, refused
from harness.contracts.errors import ModelFailed
from harness.contracts.ids import NodeId
from harness.contracts.models import ModelUse
from harness.contracts.reasons import because, plain
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Value

LONGEST_REASON = 400
MOST_STEPS = 32


class PlanStep(Value):
    """One stage of a plan: which offered stage, by which capability, after which others."""

    stage: NodeId
    capability: str
    after: tuple[NodeId, ...] = ()


class StagePlan(Value):
    """A decomposed goal. A proposal, never an authorisation (R41). `use`: the model that proposed it."""

    steps: tuple[PlanStep, ...]
    reason: str
    use: ModelUse | msgspec.UnsetType = msgspec.UNSET


@dataclass(frozen=True)
class StagePlanner:
    """Decomposes a goal, under a name that is stored with the mission. `propose` may answer anything or raise."""

    name: str
    propose: Callable[[str, TaskTemplate], StagePlan]


@dataclass(frozen=True)
class DecompositionResult:
    """The template as it is compiled, the planner's proposal, and why that was refused, if it was.

    `use`: the model that was asked, whatever came of it.
    """

    template: TaskTemplate
    planner: str
    plan: StagePlan | None
    refused: str
    use: ModelUse | None = None


def one_after_another(goal: str, template: TaskTemplate) -> StagePlan:
    """Every offered stage, each after the one before it, unless the template has it wait for nothing. Deterministic."""
    stages = [(NodeId(str(node["node_id"])), node) for node in template.nodes]
    before: list[tuple[NodeId, ...]] = [(), *((stage,) for stage, _ in stages)]
    steps = (
        PlanStep(stage=stage, capability=str(node["capabilities"][0]), after=after if node.get("depends_on") else ())
        for (stage, node), after in zip(stages, before, strict=False)
    )
    return StagePlan(steps=tuple(steps), reason="The stages that the template offers, one after another.")


ONE_AFTER_ANOTHER = StagePlanner(name="one-after-another-1", propose=one_after_another)
"""The deterministic planner: no model."""


def decomposed(planner: StagePlanner, *, goal: str, template: TaskTemplate) -> DecompositionResult:
    """Ask the planner, then admit or refuse its plan. If it is refused or raises, the harness's own plan is used."""
    plan: StagePlan | None = None
    try:
        plan = _storable(planner.propose(goal, template))
    except Exception as error:  # noqa: BLE001 - a planner that breaks has proposed nothing, whatever broke it
        why = f"{planner.name} proposed nothing usable: {type(error).__name__}: {_short(str(error))}"
        use = error.use if isinstance(error, ModelFailed) else None
        own = _ordered(template, one_after_another(goal, template))
        return DecompositionResult(own, planner.name, None, why, use)
    broken = stage_plan_refusal(plan, template=template)
    taken = one_after_another(goal, template) if broken else plan
    refused = f"{broken.rule}: {plain(broken.reason)}" if broken else ""
    use = plan.use if isinstance(plan.use, ModelUse) else None
    return DecompositionResult(_ordered(template, taken), planner.name, plan, refused, use)


def stage_plan_refusal(plan: StagePlan, *, template: TaskTemplate) -> Refused | None:
    """Why a template is not compiled from this plan, whoever made it; None if it may be (R225)."""
    offered = {NodeId(str(node["node_id"])): node for node in template.nodes}
    stages = [step.stage for step in plan.steps]
    for step in plan.steps:
        if step.stage not in offered:
            return refused("not_offered", because("stage_not_offered", offered=tuple(offered), stage=step.stage[:80]))
        if step.capability not in offered[step.stage]["capabilities"]:
            return refused("another_capability", stage=step.stage, capability=step.capability[:80])
        if unknown := set(step.after) - set(stages):
            return refused(
                "not_planned", because("dependency_not_planned", stage=step.stage, dependencies=tuple(sorted(unknown)))
            )
    if len(set(stages)) != len(stages):
        return refused("planned_twice", because("stage_planned_twice"))
    missing = [name for name, node in offered.items() if node.get("required", True) and name not in stages]
    if missing:
        return refused("stage_missing", stages=tuple(missing))
    return _order_refusal(plan, template)


def _order_refusal(plan: StagePlan, template: TaskTemplate) -> Refused | None:
    """No cycle, and every order that the goal is judged by."""
    waits = _waits(plan, template)
    ahead = {stage: _all_before(stage, waits) for stage in waits}
    circular = [stage for stage, before in ahead.items() if stage in before]
    if circular:
        return refused("circular", because("stages_circular", stages=tuple(circular)))
    for condition in template.completion_conditions:
        effect = condition["effect"]
        judged = effect.get("nodes", ()) if effect.get("predicate") == "in_order" else ()
        late = [after for before, after in pairwise(judged) if before not in ahead[NodeId(after)]]
        if late:
            return refused("out_of_order", because("stages_out_of_order", stages=tuple(late)))
    return None


def _waits(plan: StagePlan, template: TaskTemplate) -> dict[NodeId, set[NodeId]]:
    """What each planned stage waits for: the plan's dependencies and the template's own."""
    own = {NodeId(str(node["node_id"])): node.get("depends_on", ()) for node in template.nodes}
    return {step.stage: {*step.after, *(NodeId(str(one)) for one in own[step.stage])} for step in plan.steps}


def _all_before(stage: NodeId, waits: Mapping[NodeId, set[NodeId]]) -> set[NodeId]:
    found: set[NodeId] = set()
    ahead = list(waits[stage])
    while ahead:
        name = ahead.pop()
        if name not in found:
            found.add(name)
            ahead.extend(waits.get(name, ()))
    return found


def _ordered(template: TaskTemplate, plan: StagePlan) -> TaskTemplate:
    """The template with the planned stages in the plan's order; their conditions and limits are the template's."""
    nodes = {str(node["node_id"]): node for node in template.nodes}
    waits = _waits(plan, template)
    planned: tuple[dict[str, Any], ...] = tuple(
        {**nodes[step.stage], "depends_on": sorted(waits[step.stage], key=[*waits].index)} for step in plan.steps
    )
    return msgspec.structs.replace(template, nodes=planned)


def _storable(proposal: StagePlan) -> StagePlan:
    """The plan as values that can be stored. Raises TypeError if it is no plan."""
    if not isinstance(proposal, StagePlan):
        raise TypeError(f"{type(proposal).__name__} is no plan")
    if len(proposal.steps) > MOST_STEPS:
        raise TypeError(f"a plan of {len(proposal.steps)} steps, at most {MOST_STEPS} are read")
    checked = msgspec.convert(msgspec.to_builtins(proposal), StagePlan, strict=True)
    return msgspec.structs.replace(checked, reason=_short(checked.reason))


def _short(text: str) -> str:
    return text.encode("utf-8", "replace").decode()[:LONGEST_REASON]
