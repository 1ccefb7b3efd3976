"""Builds missions of rules 2 with an effect that can only be declared: nothing checks the words about a picture."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from msgspec.structs import replace

from harness.baseline.load import shipped_workspace
from harness.contracts.ids import NodeId
from harness.contracts.tasks import TaskTemplate
from harness.planning.templates import by_name
from tests.builders.connections import Stage, Wrap, staged

FIRST, SECOND, DESCRIBE = NodeId("capture"), NodeId("second"), NodeId("describe")
ORDER = {
    "condition_id": "goal.in_order",
    "text": "Two pictures were taken, in this order",
    "effect": {
        "type": "temporal",
        "predicate": "in_order",
        "interval_s": 1.0,
        "bound": 1.0,
        "nodes": [FIRST, SECOND],
    },
}
DESCRIBED = {
    "condition_id": "goal.described",
    "text": "The description is of the first picture",
    "effect": {
        "type": "relational",
        "predicate": "same_image",
        "relation": "same_image",
        "subject": DESCRIBE,
        "object": FIRST,
    },
}


def two_pictures(*, declared: bool = True, goals: tuple[dict[str, Any], ...] = (ORDER,)) -> TaskTemplate:
    """Take a picture, take another, describe the first: with consent to the describer's own word, or where a person
    would have to attest what it says.
    """
    base = by_name("camera-report", shipped_workspace().missions)
    capture, _, describe = base.nodes
    second = capture | {"node_id": SECOND, "depends_on": [FIRST]}
    second["success_conditions"] = [capture["success_conditions"][0] | {"condition_id": "second.pictured"}]
    evidence = dict(describe["evidence"])
    if not declared:
        del evidence["declared"]
        evidence["attestation"] = True
    return replace(
        base,
        name="two-pictures",
        title="Two pictures",
        goal="Take two pictures and describe the first",
        phrases=("two pictures",),
        nodes=(capture, second, describe | {"evidence": evidence}),
        completion_conditions=goals,
    )


@contextmanager
def strict(wrap: Wrap = lambda provider: provider) -> Iterator[Stage]:
    """A staged harness that pins new missions to rules 2."""
    with staged(wrap=wrap, rules=2) as stage:
        yield stage
