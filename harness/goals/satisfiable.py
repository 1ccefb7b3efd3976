"""Finds conditions that could never be shown to hold, before anything moves (D42). Pure."""

from collections.abc import Iterator
from itertools import pairwise

from harness.contracts.capabilities import Capability
from harness.contracts.effects import Condition, Symbolic
from harness.contracts.errors import Unsatisfiable
from harness.contracts.places import Site
from harness.contracts.predicates import is_installed_name
from harness.contracts.readings import ClauseObject
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import LINEAGE, RulesVersion, required_independence
from harness.contracts.tasks import Node, TaskContract, goal_independence, rests_on, stages_behind
from harness.contracts.values import Point
from harness.goals.sources import Reachable, RobotSources, rests_on_sources
from harness.planning.clauses import region_of
from harness.verification.finding import BOOKKEEPING, RECEIPTS
from harness.verification.geometry import contains
from harness.verification.predicates.registry import predicate_of

PRODUCED_BY: dict[str, tuple[Capability, ...]] = {
    "transcript": ("take_request",),
    "recorded_request": ("take_request",),
    "passage_checked": ("analyse_passage",),
    "shows": ("observe", "describe_image"),
    "message_stored": ("deliver_message",),
    "heard": ("analyse_passage", "speak"),
    "outcome_heard": ("speak",),
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
"""The shipped capabilities whose stages leave the evidence that a predicate reads; one that is missing here needs none.

A site's own capabilities declare their effects themselves, and are checked against the site's vocabulary.
"""


def check_satisfiable(contract: TaskContract, *, site: Site) -> None:
    """Raise Unsatisfiable for the first condition without a verifier or without a stage that could make its evidence.

    So is a goal whose routes lead through a region that it forbids.
    """
    for where, condition in _conditions(contract):
        if predicate_of(condition.effect) is None and not is_installed_name(condition.effect.predicate):
            raise Unsatisfiable(
                because("verifier_missing", predicate=condition.effect.predicate, condition_id=condition.condition_id),
                where=where,
            )
        offered = {capability for node in contract.nodes for capability in node.capabilities}
        missing = [name for name in PRODUCED_BY.get(condition.effect.predicate, ()) if name not in offered]
        if missing and not any("." in name for name in offered):
            raise Unsatisfiable(
                because("evidence_unmade", condition_id=condition.condition_id, capabilities=tuple(missing)),
                where=where,
            )
    _check_ways(contract, site)


MEASURED_APART = frozenset({"heard", "message_stored", "outcome_heard", "passage_checked", "shows"})
"""The predicates that nothing but an independent source can show to hold; such a source is installed with a robot."""


def check_sources(contract: TaskContract, *, robot: RobotSources, site: Site, rules: RulesVersion) -> None:
    """Raise Unsatisfiable for the first condition that the sources of this robot cannot show to hold (D17, D42).

    Either no source measures it at all, or none is as independent as the condition must be. A condition that its stage
    declares needs none, nor does one of the goal that rests on such a stage.
    """
    if rules < LINEAGE:
        return
    reachable = Reachable(contract, robot, site.vouched)
    for node in contract.nodes:
        where = f"nodes.{node.node_id}"
        for one in node.success_conditions:
            if one.condition_id in node.declared:
                continue
            _check_measured(one, robot, where)
            required = required_independence(rules, risk=node.risk, required=one.independence)
            _check_vouched(one, contract, where)
            level = reachable.of_stage(one, node)
            if level is not None and level < required:
                raise Unsatisfiable(
                    _out_of_reach(one, contract, level, required, reachable.lacking(one, (node,))), where=where
                )
    declaring = frozenset(node.node_id for node in contract.nodes if node.declared)
    for one in contract.completion_conditions:
        if rests_on(one.effect, declaring):
            continue
        _check_measured(one, robot, "completion_conditions")
        required = goal_independence(one, contract.nodes, rules=rules)
        _check_vouched(one, contract, "completion_conditions")
        level = reachable.of_goal(one)
        if level is not None and level < required:
            lacking = reachable.lacking(one, stages_behind(one.effect, contract.nodes))
            raise Unsatisfiable(_out_of_reach(one, contract, level, required, lacking), where="completion_conditions")


def _check_measured(condition: Condition, robot: RobotSources, where: str) -> None:
    predicate = condition.effect.predicate
    if predicate == "shows":
        _check_picture_reading(condition, robot, where)
    if predicate in MEASURED_APART - robot.measures:
        raise Unsatisfiable(
            because("source_missing", condition_id=condition.condition_id, predicate=predicate), where=where
        )


def _check_vouched(condition: Condition, contract: TaskContract, where: str) -> None:
    """What nobody vouches for cannot be decisive: it is said before anything moves."""
    pinned = contract.pinned.get(condition.effect.predicate)
    if pinned is not None and not pinned.vouched:
        raise Unsatisfiable(
            because(
                "predicate_needs_vouching", condition_id=condition.condition_id, predicate=condition.effect.predicate
            ),
            where=where,
        )


def _check_picture_reading(condition: Condition, robot: RobotSources, where: str) -> None:
    """Nothing here reads pictures, or nothing here knows such an object."""
    if "shows" not in robot.measures:
        unread = because("pictures_not_read", condition_id=condition.condition_id, extra="vision")
        raise Unsatisfiable(unread, where=where)
    arguments = condition.effect.arguments if isinstance(condition.effect, Symbolic) else {}
    name = str(arguments.get("name", ""))
    if arguments.get("kind") == "object" and name not in robot.objects:
        raise Unsatisfiable(because("object_not_known", condition_id=condition.condition_id, name=name), where=where)


def _out_of_reach(
    condition: Condition, contract: TaskContract, level: int, required: int, lacking: tuple[Reason, ...]
) -> Reason:
    """Why the condition cannot reach its level: `missing` names what keeps each source from being a second one."""
    sources = tuple(
        one for one in rests_on_sources(condition.effect, contract.pinned) or () if one not in (*BOOKKEEPING, RECEIPTS)
    )
    name = condition.condition_id
    if not sources:
        return because("word_alone", condition_id=name, predicate=condition.effect.predicate)
    missing = lacking or (because("facts_no_better"),)
    return because(
        "level_out_of_reach", condition_id=name, sources=sources, level=level, required=required, missing=missing
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
