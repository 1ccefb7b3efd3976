"""Asks a proposer for the next target, and admits it or falls back to the harness's own choice (R222). Pure.

A proposer, a model included, sees the question and nothing else; its target has no authority.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from harness.contracts import exploration
from harness.contracts.decisions import Refused, refused
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.values import Point
from harness.exploration.frontiers import beside
from harness.exploration.grid import cell_of
from harness.exploration.paths import Ways
from harness.projections.region import contains

WAY_COST_M = 3.0
LONGEST_REASON = 400


@dataclass(frozen=True)
class Proposer:
    """Proposes targets, under a name that is stored in the log. `propose` may return anything or raise.

    It sees the question and the picture's bytes; None: it has nothing to propose.
    """

    name: str
    propose: Callable[[exploration.TargetQuestion, bytes], exploration.TargetProposal | None]


def nearest_edge(question: exploration.TargetQuestion, picture: bytes = b"") -> exploration.TargetProposal | None:
    """The edge that shows most for its distance, away from abandoned targets. Deterministic; needs no picture."""
    return next(_edges_by_worth(question), None)


def given_up(feedback: Sequence[exploration.AnyFeedback]) -> tuple[Point, ...]:
    """The targets that could not be reached."""
    return tuple(one.target_m for one in feedback if isinstance(one, exploration.BlockedTarget))


def _edges_by_worth(question: exploration.TargetQuestion) -> Iterator[exploration.TargetProposal]:
    """Every edge away from abandoned targets, the one that shows most for its distance first."""
    abandoned = given_up(question.feedback)
    left = [one for one in question.frontiers if not beside(one.approach_m, abandoned)]
    for edge in sorted(left, key=lambda one: (_worth(one), one.approach_m), reverse=True):
        yield exploration.TargetProposal(
            target_m=edge.approach_m,
            reason=because(
                "nearest_unknown_edge",
                length_m=edge.length_m,
                x_m=edge.edge_m[0],
                y_m=edge.edge_m[1],
                way_m=edge.way_m,
                open=len(left),
                edges=len(question.frontiers),
            ),
        )


NEAREST_EDGE = Proposer(name="nearest-edge-1", propose=nearest_edge)
"""The deterministic proposer: no model."""


def target_refusal(
    target: Point, *, question: exploration.TargetQuestion, grid: exploration.GridMap, ways: Ways
) -> Refused | None:
    """Why this target is refused, whoever proposed it; None if it is allowed (R222)."""
    position = f"({target[0]:.2f}, {target[1]:.2f})"
    row, column = cell_of(grid, target) if all(math.isfinite(part) for part in target) else (-1, -1)
    if not (0 <= row < grid.rows and 0 <= column < grid.columns):
        return refused("outside_map", because("target_outside_map", at=position, map_version=question.map_version))
    if not any(contains(zone, target) for zone in question.zones_m):
        return refused("outside_zones", because("target_outside_zones", at=position))
    if any(contains(region, target) for region in question.keep_out_m):
        return refused("keep_out", because("target_kept_out", at=position))
    if beside(target, given_up(question.feedback)):
        return refused("given_up_before", because("target_given_up", at=position))
    return _way_refusal(position, question=question, way_m=ways.length_m((row, column)))


def _way_refusal(position: str, *, question: exploration.TargetQuestion, way_m: float | None) -> Refused | None:
    if way_m is None:
        return refused("unreachable", because("target_unreachable", at=position))
    if way_m > question.longest_way_m:
        return refused("too_far", because("target_too_far", at=position, way_m=way_m, longest_m=question.longest_way_m))
    spent = question.left < 1
    return refused("over_budget", because("targets_spent")) if spent else None


def answered(
    proposer: Proposer, *, question: exploration.TargetQuestion, grid: exploration.GridMap, picture: bytes
) -> exploration.TargetAnswer:
    """Ask the proposer, then admit or refuse. If it is refused or raises, the harness's own edge is used."""
    proposal: exploration.TargetProposal | None = None
    refused: Explanation = ""
    try:
        proposal = _storable(proposer.propose(question, picture))
    except Exception as error:  # noqa: BLE001 - a proposer that breaks has proposed nothing, whatever broke it
        refused = because(
            "proposed_nothing_usable", planner=proposer.name, kind=type(error).__name__, error=_short(str(error))
        )
    return target_choice(proposer.name, proposal, refused=refused, question=question, grid=grid)


def target_choice(
    planner: str,
    proposal: exploration.TargetProposal | None,
    *,
    refused: Explanation,
    question: exploration.TargetQuestion,
    grid: exploration.GridMap,
) -> exploration.TargetAnswer:
    """The target that follows from the proposal; replay derives it again from the records.

    In the place of a refused one stands the best edge that is not refused: one outside the zones ends no exploration
    while others are left.
    """
    ways = Ways(grid, question.position_m, keep_out_m=question.keep_out_m)
    broken = target_refusal(proposal.target_m, question=question, grid=grid, ways=ways) if proposal else None
    if broken is not None:
        refused = because("target_refused", rule=broken.rule, why=broken.reason)
    chosen = proposal if broken is None else None
    if refused:
        own = _edges_by_worth(question)
        fitting = (one for one in own if target_refusal(one.target_m, question=question, grid=grid, ways=ways) is None)
        chosen = next(fitting, None)
    route = ways.route_m(chosen.target_m) if chosen else ()
    return exploration.TargetAnswer(planner=planner, said=proposal, refused=refused, chosen=chosen, route_m=route)


def _worth(frontier: exploration.Frontier) -> float:
    return frontier.length_m / (frontier.way_m + WAY_COST_M)


def _storable(proposal: exploration.TargetProposal | None) -> exploration.TargetProposal | None:
    """The proposal as values that the log can hold. Raises TypeError if it is no proposal."""
    if proposal is None:
        return None
    if not isinstance(proposal, exploration.TargetProposal):
        raise TypeError(f"{type(proposal).__name__} is no target")
    x, y = (float(part) for part in proposal.target_m)
    if not (math.isfinite(x) and math.isfinite(y)):
        raise TypeError("the target is not finite")
    return exploration.TargetProposal(
        target_m=(x, y), reason=proposal.reason if isinstance(proposal.reason, Reason) else _short(str(proposal.reason))
    )


def _short(text: str) -> str:
    return text.encode("utf-8", "replace").decode()[:LONGEST_REASON]
