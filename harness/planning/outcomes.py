"""Says what the parts of a mission achieved, for the stage that reports it and its conditions. Pure.

Each part's own sentence is bound when the mission is compiled; it is spoken after the gate has accepted its stages.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from msgspec.structs import replace

from harness.contracts.effects import Condition, Symbolic
from harness.contracts.ids import NodeId
from harness.contracts.tasks import TaskContract

PREDICATE = "outcome_heard"


@dataclass(frozen=True)
class AchievedPart:
    """What one part achieved once its stages are accepted: a sentence, the stages, and the places it is bound to."""

    sentence: str
    stages: tuple[NodeId, ...]
    places: tuple[str, ...]


def told(parts: Sequence[AchievedPart]) -> str:
    """The sentences of the parts in their order; what was done several times is said once, with how often."""
    found = []
    for sentence, alike in groupby(part.sentence for part in parts):
        times = len(list(alike))
        found.append(sentence if times == 1 else f"{sentence} I did so {times} times.")
    return " ".join(found)


def with_outcomes(contract: TaskContract, parts: Sequence[AchievedPart]) -> TaskContract:
    """The contract of a report, whose conditions name the stages that it tells of, and the places in its words."""
    text = told(parts)
    stages = dict.fromkeys(stage for part in parts for stage in part.stages)
    places = dict.fromkeys(name for part in parts for name in part.places if name in text)
    named = {f"stage_{number}": str(stage) for number, stage in enumerate(stages, start=1)}
    named |= {f"name_{number}": name for number, name in enumerate(places, start=1)}
    nodes = tuple(
        replace(node, success_conditions=tuple(_naming(one, named) for one in node.success_conditions))
        for node in contract.nodes
    )
    goals = tuple(_naming(one, named) for one in contract.completion_conditions)
    return replace(contract, nodes=nodes, completion_conditions=goals)


def _naming(condition: Condition, named: dict[str, str]) -> Condition:
    effect = condition.effect
    if not isinstance(effect, Symbolic) or effect.predicate != PREDICATE:
        return condition
    return replace(condition, effect=replace(effect, arguments={**effect.arguments, **named}))
