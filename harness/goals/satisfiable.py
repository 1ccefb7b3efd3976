"""Finds conditions that could never be shown to hold, before anything moves (D42). Pure."""

from collections.abc import Collection, Iterator
from itertools import pairwise

from harness.contracts.capabilities import Capability
from harness.contracts.effects import Condition
from harness.contracts.errors import Unsatisfiable
from harness.contracts.places import Site
from harness.contracts.readings import ClauseObject
from harness.contracts.reasons import because
from harness.contracts.rules import LINEAGE, RulesVersion
from harness.contracts.tasks import Node, TaskContract
from harness.contracts.values import Point
from harness.planning.clauses import region_of
from harness.verification.geometry import contains
from harness.verification.predicates.registry import predicate_of

PRODUCED_BY: dict[str, tuple[Capability, ...]] = {
    "transcript": ("take_request",),
    "recorded_request": ("take_request",),
    "passage_checked": ("analyse_passage",),
    "message_stored": ("deliver_message",),
    "heard": ("analyse_passage", "speak"),
    "one_chain": ("capture_panorama", "analyse_passage", "deliver_message", "take_request"),
    "kept_picture": ("observe", "keep_evidence"),
    "covered": ("observe",),
    "arrival": ("navigate",),
    "circuit": ("navigate",),
    "panorama": ("capture_panorama",),
    "pictured": ("observe",),
    "sighted": ("analyse_passage",),
    "analysis_of": ("analyse_passage",),
    "delivered": ("deliver_message",),
    "played": ("speak",),
    "linked": ("capture_panorama", "analyse_passage", "deliver_message", "take_request"),
    "reported": ("analyse_passage", "deliver_message", "speak"),
    "explored": ("observe",),
    "same_image": ("observe",),
    "one_image": ("observe",),
}
"""The capabilities whose stages leave the evidence that a predicate reads; one that is missing here needs none."""


def check_satisfiable(contract: TaskContract, *, site: Site) -> None:
    """Raise Unsatisfiable for the first condition without a verifier or without a stage that could make its evidence.

    So is a goal whose routes lead through a region that it forbids.
    """
    for where, condition in _conditions(contract):
        if predicate_of(condition.effect) is None:
            raise Unsatisfiable(
                because("verifier_missing", predicate=condition.effect.predicate, condition_id=condition.condition_id),
                where=where,
            )
        offered = {capability for node in contract.nodes for capability in node.capabilities}
        missing = [name for name in PRODUCED_BY.get(condition.effect.predicate, ()) if name not in offered]
        if missing:
            raise Unsatisfiable(
                because("evidence_unmade", condition_id=condition.condition_id, capabilities=tuple(missing)),
                where=where,
            )
    _check_ways(contract, site)


MEASURED_APART = frozenset({"heard", "message_stored", "passage_checked"})
"""The predicates that nothing but an independent source can show to hold; such a source is installed with a robot."""


def check_sources(contract: TaskContract, *, supplied: Collection[str], rules: RulesVersion) -> None:
    """Raise Unsatisfiable for the first condition that no source of this robot can show to hold (D17, D42).

    `supplied`: the predicates that its independent sources are able to measure. A condition that its stage declares
    needs none, nor does one of the goal that rests on such a stage.
    """
    if rules < LINEAGE:
        return
    declared = {
        one.effect.predicate
        for node in contract.nodes
        for one in node.success_conditions
        if one.condition_id in (node.evidence.declared or ())
    }
    stages = ((f"nodes.{node.node_id}", node, one) for node in contract.nodes for one in node.success_conditions)
    needed = [(where, one) for where, node, one in stages if one.condition_id not in (node.evidence.declared or ())]
    goal = [one for one in contract.completion_conditions if one.effect.predicate not in declared]
    for where, condition in (*needed, *(("completion_conditions", one) for one in goal)):
        if condition.effect.predicate in MEASURED_APART - set(supplied):
            raise Unsatisfiable(
                f"No source apart from the provider can show {condition.condition_id}: {condition.effect.predicate}",
                where=where,
                do="connect such a source to this robot, or declare the condition in the stage's evidence policy",
            )


def _conditions(contract: TaskContract) -> Iterator[tuple[str, Condition]]:
    for node in contract.nodes:
        yield from ((f"nodes.{node.node_id}", one) for one in node.success_conditions)
    yield from (("completion_conditions", one) for one in contract.completion_conditions)


def _check_ways(contract: TaskContract, site: Site) -> None:
    """A leg whose route crosses a forbidden region would end unsafe: it is refused now."""
    for name in contract.constraints.keep_out:
        region = _region(name, site)
        for node in contract.nodes:
            if len(region) > 2 and _crosses(node, region):
                raise Unsatisfiable(
                    because("way_through_forbidden", node_id=node.node_id, region=name),
                    where=f"nodes.{node.node_id}",
                )


def _region(name: str, site: Site) -> tuple[Point, ...]:
    kinds = ("place", "passage", "region")
    found = (region_of(ClauseObject(kind=kind, id=name), site) for kind in kinds)  # type: ignore[arg-type]
    return next((region for region in found if region), ())


def _crosses(node: Node, region: tuple[Point, ...]) -> bool:
    """Whether the stage's route, looked at every 0.1 m, has a point in the region."""
    route = node.parameters.get("route", ())
    points = [point for point in route if isinstance(point, tuple)] if isinstance(route, tuple) else []
    return any(contains(region, point) for point in _along(points))


def _along(points: list[Point]) -> Iterator[Point]:
    for (ax, ay), (bx, by) in pairwise(points):
        steps = max(1, round(10 * max(abs(bx - ax), abs(by - ay))))
        for step in range(steps + 1):
            yield ax + (bx - ax) * step / steps, ay + (by - ay) * step / steps
