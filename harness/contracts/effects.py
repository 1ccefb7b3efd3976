"""Typed effects (R13): what must become true, in five kinds, and the conditions that test them.

A predicate's name selects the function in `verification/predicates`; a name without a function is ambiguous, never
true.
"""

from typing import Annotated, Literal

import msgspec

from harness.contracts import values
from harness.contracts.ids import ConditionId, NodeId


class Effect(values.Value, tag_field="type"):
    """Base of the five kinds."""

    predicate: values.Name


class Symbolic(Effect, tag="symbolic"):
    """A named fact over named arguments, such as requested(goal) or delivered(report)."""

    arguments: dict[str, str]


class Metric(Effect, tag="metric"):
    """A planar quantity against a bound: frame, target and tolerance are mandatory (R17)."""

    frame: values.Name
    map_version: values.Name
    target_m: values.Point
    tolerance_m: values.Positive
    route_m: tuple[values.Point, ...] = ()
    bounds: dict[str, float] = msgspec.field(default_factory=dict)


class Relational(Effect, tag="relational"):
    """`subject` stands in `relation` to `object`; both name nodes, places or entities.

    A relation in the map states its region: a polygon in `frame` of `map_version`, metres.
    """

    relation: values.Name
    subject: values.Name
    object: values.Name
    frame: str = ""
    map_version: str = ""
    region_m: tuple[values.Point, ...] = ()


class Visual(Effect, tag="visual"):
    """`frames` images of at least this size that satisfy the predicate."""

    frames: Annotated[int, msgspec.Meta(ge=1)]
    width_px: values.Count
    height_px: values.Count


class Temporal(Effect, tag="temporal"):
    """Something holds for `interval_s`, with `bound` in the predicate's unit, or `nodes` ended in this order (R14).

    `stable` tests `inner` at every look of the interval; its `bound` is the longest time without a look, seconds.
    """

    interval_s: values.Positive
    bound: values.Positive
    nodes: tuple[NodeId, ...] = ()
    inner: Symbolic | Metric | Relational | Visual | None = None


AnyEffect = Symbolic | Metric | Relational | Visual | Temporal

FactKind = Literal["event", "state"]
Independence = Annotated[int, msgspec.Meta(ge=0, le=2)]


class Condition(values.Value):
    """One declared test. `fact` says whether its fact is permanent or holds only while it is true (D20).

    `clause`: what of the reading it is tested for (D42): a clause by its number, or `profile.return` for a default of
    the mission profile. Missing in contracts of earlier releases, and in the conditions of single stages.
    """

    condition_id: ConditionId
    text: values.Name
    effect: AnyEffect
    fact: FactKind = "event"
    independence: Independence | None = None
    clause: values.Name | msgspec.UnsetType = msgspec.UNSET


class Precondition(values.Value):
    """Tested again at every dispatch (R18). `target_m` and `tolerance_m` go with `at_place`."""

    predicate: Literal["localised", "hardware_stop_released", "at_place", "static"]
    target_m: values.Point | None = None
    tolerance_m: float | None = None
