"""Turns a route into the nodes and edges of an order, of which only the next metres are released. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import msgspec

from harness.adapters.providers.vda5050.messages import OrderEdge, OrderNode
from harness.contracts.errors import ProviderFailed
from harness.contracts.protocol import StartRequest
from harness.contracts.reasons import because
from harness.contracts.values import Point

OFF_ROUTE_M = 1.0
"""A vehicle further beside its route gets no order: the way to the route was not authorised."""
PASSED_M = 0.3
"""How near a node on the way counts as passed."""
SPACING_SHARE = 1 / 3
NEAREST_M = 0.05


@dataclass(frozen=True)
class RoutePlan:
    """The whole way of one request. Node `i` has the sequence id `2 i`, the edge after it `2 i + 1`.

    `along_m` is how far each node lies along the way. The first node is where the vehicle stood.
    """

    order_id: str
    points: tuple[Point, ...]
    along_m: tuple[float, ...]
    speed_mps: float
    deviation_m: float
    base_m: float

    @property
    def last(self) -> int:
        """The index of the node at the target."""
        return len(self.points) - 1

    @property
    def length_m(self) -> float:
        return self.along_m[-1]

    def base_end(self, passed: int) -> int:
        """The last node that may be released once node `passed` was passed: so much of the way, and one node more."""
        return next((i for i, at_m in enumerate(self.along_m) if at_m >= self.along_m[passed] + self.base_m), self.last)

    def nodes(self, first: int, base_end: int) -> tuple[OrderNode, ...]:
        """The nodes of an order, or of an update that begins with node `first`."""
        return tuple(
            OrderNode(
                node_id=self.node_id(i),
                sequence_id=2 * i,
                released=i <= base_end,
                x_m=self.points[i][0],
                y_m=self.points[i][1],
                deviation_m=self.deviation_m if i == self.last else PASSED_M,
            )
            for i in range(first, self.last + 1)
        )

    def edges(self, first: int, base_end: int) -> tuple[OrderEdge, ...]:
        return tuple(
            OrderEdge(
                edge_id=f"{self.node_id(i)}-edge",
                sequence_id=2 * i + 1,
                released=i < base_end,
                start_node_id=self.node_id(i),
                end_node_id=self.node_id(i + 1),
                speed_mps=self.speed_mps,
            )
            for i in range(first, self.last)
        )

    def node_id(self, index: int) -> str:
        return f"{self.order_id[:12]}-{index}"


def route_plan(request: StartRequest, *, here: Point, base_m: float) -> RoutePlan:
    """The way from `here` along the route to the target. Raises ProviderFailed for a vehicle beside its route."""
    parameters = request.parameters
    route = [_point(one) for one in parameters["route"]]  # type: ignore[union-attr]
    target = _point(parameters["target"])
    way = [*route, target] if not route or math.dist(route[-1], target) > NEAREST_M else [*route[:-1], target]
    joined, beside_m = _from(way, here)
    if beside_m > OFF_ROUTE_M:
        raise ProviderFailed(because("vehicle_off_route", beside_m=beside_m, limit_m=OFF_ROUTE_M))
    points = _spaced([here, *joined], spacing_m=base_m * SPACING_SHARE)
    along = [0.0]
    for one, other in pairwise(points):
        along.append(along[-1] + math.dist(one, other))
    return RoutePlan(
        order_id=request.identity.request_id,
        points=tuple(points),
        along_m=tuple(along),
        speed_mps=float(parameters["speed_cap_mps"]),  # type: ignore[arg-type]
        deviation_m=float(parameters["tolerance_m"]) / 2,  # type: ignore[arg-type]
        base_m=base_m,
    )


def _from(way: Sequence[Point], here: Point) -> tuple[list[Point], float]:
    """What is left of a way from the point of it that is nearest, and how far that point lies beside, metres."""
    best: tuple[float, list[Point]] = (math.dist(way[-1], here), [way[-1]])
    for index, (one, other) in enumerate(pairwise(way)):
        near = _nearest(one, other, here)
        beside_m = math.dist(near, here)
        if beside_m < best[0] - 1e-9:
            onto = [near] if beside_m > NEAREST_M else []
            best = (beside_m, [*onto, *way[index + 1 :]])
    return best[1], best[0]


def _nearest(one: Point, other: Point, here: Point) -> Point:
    dx, dy = other[0] - one[0], other[1] - one[1]
    length2 = dx * dx + dy * dy
    share = 0.0 if length2 == 0.0 else ((here[0] - one[0]) * dx + (here[1] - one[1]) * dy) / length2
    share = min(1.0, max(0.0, share))
    return one[0] + share * dx, one[1] + share * dy


def _spaced(way: Sequence[Point], *, spacing_m: float) -> list[Point]:
    """The way with nodes at most so far apart, and none twice; its own points are nodes as they are, to the bit."""
    points = [way[0]]
    for one, other in pairwise(way):
        length_m = math.dist(one, other)
        if length_m < NEAREST_M and other != way[-1]:
            continue
        parts = max(1, math.ceil(length_m / spacing_m))
        points += [
            (one[0] + (other[0] - one[0]) * part / parts, one[1] + (other[1] - one[1]) * part / parts)
            for part in range(1, parts)
        ]
        points.append(other)
    return points


def _point(value: object) -> Point:
    found: Point = msgspec.convert(value, Point)
    return found
