"""Pure: who proposed what in a mission, the deterministic roles or a model by name, with cost and time."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from app.i18n.reasons import rendering as reasons
from app.views.timeline import TimelineEntry
from harness.contracts.events import ModelAdvised, NodePlanned
from harness.contracts.models import ModelAdvice


@dataclass(frozen=True)
class ModelTotal:
    """One model's answers in one mission: how many, how many were refused, seconds of waiting, and cost."""

    model: str
    asked: int
    refused: int
    seconds: float
    cost: float
    currency: str


@dataclass(frozen=True)
class PlannerShare:
    """How many stages a planner proposed; `overruled`: where the harness refused that and took its own."""

    planner: str
    stages: int
    overruled: int


@dataclass(frozen=True)
class Proposers:
    """Who proposed in a mission. No `models`: every role was deterministic."""

    planners: tuple[PlannerShare, ...]
    models: tuple[ModelTotal, ...]
    advice: tuple[ModelAdvice, ...]


def proposers(entries: Sequence[TimelineEntry]) -> Proposers:
    """Who proposed, by the mission's own events."""
    plans = [entry.event for entry in entries if isinstance(entry.event, NodePlanned)]
    counts = Counter(plan.planner for plan in plans)
    overruled = Counter(plan.planner for plan in plans if plan.refused)
    advice = tuple(entry.event.advice for entry in entries if isinstance(entry.event, ModelAdvised))
    models = dict.fromkeys(one.use.model for one in advice)
    return Proposers(
        planners=tuple(PlannerShare(name, count, overruled[name]) for name, count in counts.items()),
        models=tuple(_total(name, [one for one in advice if one.use.model == name]) for name in models),
        advice=advice,
    )


def proposers_json(entries: Sequence[TimelineEntry]) -> dict[str, Any]:
    """The same as plain JSON."""
    found = proposers(entries)
    return {
        "planners": msgspec.to_builtins(found.planners),
        "models": msgspec.to_builtins(found.models),
        "advice": [
            {
                "role": one.role,
                "node_id": one.node_id,
                "model": one.use.model,
                "said": one.said,
                "action": one.action,
                **reasons.stated("refused", one.refused),
                "seconds": one.use.seconds,
                "cost": one.use.cost,
                "currency": one.use.currency,
                "input_tokens": one.use.input_tokens,
                "output_tokens": one.use.output_tokens,
                "exchange": one.use.exchange,
            }
            for one in found.advice
        ],
    }


def _total(model: str, advice: Sequence[ModelAdvice]) -> ModelTotal:
    return ModelTotal(
        model=model,
        asked=len(advice),
        refused=sum(bool(one.refused) for one in advice),
        seconds=sum(one.use.seconds for one in advice),
        cost=sum(one.use.cost for one in advice),
        currency=advice[0].use.currency,
    )
