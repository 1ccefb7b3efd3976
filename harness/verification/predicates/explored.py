"""symbolic explored: enough accepted views from places far enough apart. Does not judge what the views show."""

import math

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.evidence import CommittedFact
from harness.contracts.reasons import because
from harness.contracts.values import Point
from harness.verification.finding import FACTS, RECEIPTS, Finding, Undecidable
from harness.verification.reading import Evidence


def explored(effect: AnyEffect, evidence: Evidence) -> Finding:
    """`arguments.views` accepted facts `pictured` with distinct images, each `apart_m` or more from all the others."""
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="explored"))
    required, apart_m = _number(effect, "views"), _number(effect, "apart_m")
    placed = [fact for fact in evidence.facts if fact.name == "pictured" and "x_m" in fact.measured]
    views: list[CommittedFact] = []
    for fact in sorted(placed, key=lambda one: (one.at_s, one.node_id)):
        fresh = fact.arguments["images"] not in [one.arguments["images"] for one in views]
        if fresh and all(math.dist(_point(fact), _point(one)) >= apart_m for one in views):
            views.append(fact)
    images = tuple(image for fact in views for image in fact.arguments["images"])
    for image in images:
        evidence.bytes_of(image)
    return Finding(
        verdict="satisfied" if len(views) >= required else "violated",
        reason=because("views_apart", views=len(views), apart_m=apart_m, wanted=required),
        measured={"views": float(len(views)), "pictures": float(len(placed))},
        bounds={"views": required, "apart_m": apart_m},
        sources=(FACTS, "localiser", RECEIPTS),
        evidence=images,
    )


def _point(fact: CommittedFact) -> Point:
    return fact.measured["x_m"], fact.measured["y_m"]


def _number(effect: Symbolic, name: str) -> float:
    try:
        return float(effect.arguments[name])
    except (KeyError, ValueError) as error:
        raise Undecidable(because("condition_without_argument", name=name, error=str(error))) from error
