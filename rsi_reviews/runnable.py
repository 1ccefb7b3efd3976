"""Finds what would keep a candidate from running at all, before anything is measured: its templates are compiled on a
site made up for them. Pure.

A candidate that cannot run is not worse than its baseline, it is no candidate: missions under it could only fail.
"""

from collections.abc import Iterator
from typing import get_args

from harness.contracts import configuration
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import PlaceId
from harness.contracts.places import Passage, Place, Route, Site, Zone
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Explanation, Fact, Reason, because, plain
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import Point
from harness.goals.satisfiable import check_satisfiable
from harness.goals.vocabulary import check_vocabulary
from harness.planning.compile import Argument, compile_contract
from harness.workspace.capability_types import shipped_vocabulary
from rsi_reviews.contracts import RestrictionViolation
from rsi_reviews.template_restrictions import display_value

ITEM_FLOORS: dict[str, int] = {"c1_items": 2, "c2_items": 4, "c4_items": 5}
"""As many records as the planner, a skill and recovery must be shown in any mission: below it no context compiles."""
EVIDENCE: frozenset[str] = frozenset({
    "trajectory", "pose", "poses", "odometry", "imu", "image", "images", "frames", "receipts", "measured",
    "attestation",
    *get_args(Receipt.__annotations__["kind"]),
})  # fmt: skip
"""The kinds of evidence that a packet can hold; one that a stage needs beside these is never there."""
_FRAME, _MAP = "map", "trial-1"
_APART_M = 10.0
_AROUND_M = 2.0


def unrunnable(
    baseline: configuration.Configuration, candidate: configuration.Configuration
) -> tuple[RestrictionViolation, ...]:
    """Every reason why missions could not run under the candidate; what its baseline has too is left out."""
    known = {(one.rule, one.path) for one in _flaws(baseline)}
    return tuple(one for one in _flaws(candidate) if (one.rule, one.path) not in known)


def _flaws(one: configuration.Configuration) -> Iterator[RestrictionViolation]:
    yield from _contexts(one.context_rules)
    for template in one.templates:
        yield from _template(template)
    yield from _ladders(one)


def _contexts(rules: configuration.ContextRules) -> Iterator[RestrictionViolation]:
    for name, floor in ITEM_FLOORS.items():
        items = getattr(rules, name)
        if items < floor:
            yield _refusal("context_too_small", f"context_rules.{name}", "", items, "too_few_records", least=floor)


def _template(template: TaskTemplate) -> Iterator[RestrictionViolation]:
    path = f"templates.{template.name}"
    try:
        contract = _compiled(template)
    except (ContractInvalid, UnknownName) as error:
        why = error.reason
        yield RestrictionViolation(
            rule=why.code, path=_path_of(error.where, path), reason=because("cannot_be_compiled", why=why)
        )
        return
    for act, stage in (template.stages or {}).items():
        if stage not in {node.node_id for node in contract.nodes}:
            yield _refusal("stage_missing", f"{path}.stages.{act}", "", stage, "template_stage_missing")
    yield from _budgets(path, contract)
    yield from _evidence(path, contract)


def _path_of(where: Explanation, template: str) -> str:
    """The path of a field of the template, or the template with where else it is."""
    if isinstance(where, Reason) and "field" in where.facts:
        return f"{template}.{str(where.facts['field']).removeprefix('$').removeprefix('.')}".rstrip(".")
    return f"{template}: {where if isinstance(where, str) else plain(where)}"


def _budgets(path: str, contract: TaskContract) -> Iterator[RestrictionViolation]:
    """A budget of nothing beside counters that it should pay for: no step could ever be taken."""
    for node in contract.nodes:
        counters = sum(getattr(node.recovery, action) for action in configuration.SPENDING)
        if bool(counters) != bool(node.recovery.total):
            yield _refusal(
                "zero_budget",
                f"{path}.nodes.{node.node_id}.recovery.total",
                "",
                node.recovery.total,
                "budget_pays_nothing",
            )
    if contract.recovery_total == 0 and any(node.recovery.total for node in contract.nodes):
        yield _refusal("zero_budget", f"{path}.recovery_total", "", 0, "budget_pays_nothing")


def _evidence(path: str, contract: TaskContract) -> Iterator[RestrictionViolation]:
    for node in contract.nodes:
        for name in node.evidence.mandatory:
            if name not in EVIDENCE:
                yield _refusal(
                    "unknown_evidence",
                    f"{path}.nodes.{node.node_id}.evidence.mandatory",
                    "",
                    name,
                    "evidence_never_there",
                    kinds=tuple(sorted(EVIDENCE)),
                )


def _ladders(one: configuration.Configuration) -> Iterator[RestrictionViolation]:
    """A spending step that stands on a ladder more often than any stage could pay for is never taken the last time."""
    nodes = [node for template in one.templates for node in template.nodes]
    for failure, ladder in one.recovery.ladders.items():
        for action in dict.fromkeys(step for step in ladder if step in configuration.SPENDING):
            paid = max((_count(node, action) for node in nodes), default=0)
            if ladder.count(action) > paid:
                yield _refusal(
                    "ladder_cycle",
                    f"recovery.ladders.{failure}",
                    "",
                    ladder,
                    "step_never_paid",
                    action=action,
                    times=ladder.count(action),
                    paid=paid,
                )


def _count(node: object, action: str) -> int:
    limits = node.get("recovery", {}) if isinstance(node, dict) else {}
    count = limits.get(action, 0) if isinstance(limits, dict) else 0
    return count if isinstance(count, int) else 0


def _compiled(template: TaskTemplate) -> TaskContract:
    """The template as a contract on a made-up site that has all it may refer to. Raises as compiling does."""
    site = _site(template)
    contract = compile_contract(
        goal="A trial of this template",
        template=template,
        arguments=_arguments(template),
        site=site,
        achieved="A trial was made.",
    )
    check_satisfiable(contract, site=site)
    check_vocabulary(contract, shipped_vocabulary())
    return contract


def _arguments(template: TaskTemplate) -> dict[str, Argument]:
    own: dict[str, Argument] = {"frame": _FRAME, "map_version": _MAP}
    given: dict[str, Argument] = {}
    for one in template.parameters:
        match one.type:
            case "place":
                given[one.name] = _place_id(one.name)
            case "number":
                given[one.name] = one.default if one.default is not None else 1.0
            case _:
                given[one.name] = own.get(one.name) or one.default or "text"
    return given


def _site(template: TaskTemplate) -> Site:
    """Its places stand in a row; a route leads from each to each, a passage lies in each, and one zone holds all."""
    names = [one.name for one in template.parameters if one.type == "place"]
    places = tuple(_place(name, number) for number, name in enumerate(names))
    return Site(
        name="trial",
        frame=_FRAME,
        map_version=_MAP,
        places=places,
        routes=tuple(_route(one, other) for one in places for other in places),
        passages=tuple(
            Passage(passage_id=PlaceId(f"passage-{one.place_id}"), frame=_FRAME, floor_m=_square(one.approach_m, 1.0))
            for one in places
        ),
        zones=(
            Zone(
                name="everywhere",
                frame=_FRAME,
                region_m=_square((0.0, 0.0), 1e4),
                no_answer="hold",
                hold_limit_s=900.0,
            ),
        ),
    )


def _place(name: str, number: int) -> Place:
    at_m = (_APART_M * number, 0.0)
    return Place(
        place_id=_place_id(name),
        name=name,
        frame=_FRAME,
        map_version=_MAP,
        approach_m=at_m,
        provenance="made up for a trial",
        verification="configured",
        region_m=_square(at_m, _AROUND_M),
    )


def _place_id(name: str) -> PlaceId:
    return PlaceId(f"place_{name}")


def _route(one: Place, other: Place) -> Route:
    (ax, ay), (bx, by) = one.approach_m, other.approach_m
    return Route(
        name=f"{one.place_id} to {other.place_id}",
        frame=_FRAME,
        map_version=_MAP,
        start=one.place_id,
        end=other.place_id,
        waypoints_m=((ax, ay), (0.5 * (ax + bx), 3.0), (bx, by)),
    )


def _square(middle: Point, half_m: float) -> tuple[Point, ...]:
    x, y = middle
    return tuple((x + right * half_m, y + up * half_m) for right, up in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


def _refusal(rule: str, path: str, old: str, new: object, code: str, **facts: Fact) -> RestrictionViolation:
    return RestrictionViolation(rule=rule, path=path, old=old, new=display_value(new), reason=because(code, **facts))
