"""Shapes the floor as it was known when a target was chosen, and what the way there added, drawn to scale."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby

from app.views.svg_floor import polyline, view_box
from harness.contracts import exploration
from harness.contracts.values import Point

EDGE_M = (0.28, 0.7)
"""The smallest and the largest radius of an edge's mark; its area grows with the edge."""
KNOWN_M = 1.5
"""The margin around the known floor, in metres."""


@dataclass(frozen=True)
class EdgeMark:
    """An edge on the map: its number where one would stand for it, as large as it promises."""

    number: int
    x: float
    y: float
    r: float
    chosen: bool


@dataclass(frozen=True)
class MapPoint:
    """One point of the map, in its view box."""

    x: float
    y: float


@dataclass(frozen=True)
class ExploredFloor:
    """In metres, the y axis turned so that north is up. `free`, `closed`, `gained` are SVG paths of cells.

    `target` is where the robot was sent, `refused` where the proposer wanted it and the harness did not.
    """

    box: str
    free: str
    closed: str
    gained: str
    keep_out: tuple[str, ...]
    route: str
    marks: tuple[EdgeMark, ...]
    robot: MapPoint
    target: MapPoint | None
    refused: MapPoint | None


def explored_floor(
    before: exploration.GridMap | None,
    after: exploration.GridMap | None,
    *,
    question: exploration.TargetQuestion | None,
    answer: exploration.TargetAnswer | None,
) -> ExploredFloor | None:
    """None where the map or the question is not kept any more. `after` is None until the way there was mapped."""
    if before is None or question is None:
        return None
    chosen = answer.chosen if answer else None
    proposal = answer.said if answer and answer.refused else None
    longest = max((one.length_m for one in question.frontiers), default=1.0)
    return ExploredFloor(
        box=_box(after or before, question),
        free=_cells(before, lambda index: before.cells[index] == exploration.FREE),
        closed=_cells(after or before, lambda index: (after or before).cells[index] == exploration.OCCUPIED),
        gained=_cells(after, _gained(before, after)) if after else "",
        keep_out=tuple(polyline(region) for region in question.keep_out_m),
        route=polyline(answer.route_m) if answer else "",
        marks=tuple(
            EdgeMark(
                number=number,
                x=round(one.approach_m[0], 3),
                y=round(-one.approach_m[1], 3),
                r=round(EDGE_M[0] + (EDGE_M[1] - EDGE_M[0]) * (one.length_m / longest) ** 0.5, 3),
                chosen=chosen is not None and one.approach_m == chosen.target_m,
            )
            for number, one in enumerate(question.frontiers, start=1)
        ),
        robot=_spot(question.position_m),
        target=_spot(chosen.target_m) if chosen else None,
        refused=_spot(proposal.target_m) if proposal else None,
    )


def _gained(before: exploration.GridMap, after: exploration.GridMap) -> Callable[[int], bool]:
    """Floor that was not known to be free and is now; nothing where the two are maps of different floors."""
    same = (before.columns, before.rows, before.origin_m) == (after.columns, after.rows, after.origin_m)
    return lambda index: same and after.cells[index] == exploration.FREE and before.cells[index] != exploration.FREE


def _cells(grid: exploration.GridMap, proposal: Callable[[int], bool]) -> str:
    """The wanted cells as one path: a rectangle for every run of them in a row."""
    return "".join(
        f"M{grid.origin_m[0] + first * grid.cell_m:.2f} {-(grid.origin_m[1] + (row + 1) * grid.cell_m):.2f}"
        f"h{count * grid.cell_m:.2f}v{grid.cell_m:.2f}h-{count * grid.cell_m:.2f}z"
        for row, first, count in _runs(grid, proposal)
    )


def _runs(grid: exploration.GridMap, proposal: Callable[[int], bool]) -> Iterator[tuple[int, int, int]]:
    """(row, first column, how many) of every stretch of wanted cells."""
    for row in range(grid.rows):
        column = 0
        for fits, cells in groupby(range(row * grid.columns, (row + 1) * grid.columns), key=proposal):
            count = sum(1 for _ in cells)
            if fits:
                yield row, column, count
            column += count


def _box(grid: exploration.GridMap, question: exploration.TargetQuestion) -> str:
    """The view box around the known floor and the robot."""
    known = [(row, column, count) for row, column, count in _runs(grid, lambda index: grid.cells[index] != 0)]
    xs = [grid.origin_m[0] + side * grid.cell_m for _, first, count in known for side in (first, first + count)]
    ys = [grid.origin_m[1] + side * grid.cell_m for row, _, _ in known for side in (row, row + 1)]
    xs, ys = [*xs, question.position_m[0]], [*ys, question.position_m[1]]
    return view_box(xs, ys, margin_m=KNOWN_M)[0]


def _spot(at_m: Point) -> MapPoint:
    return MapPoint(x=round(at_m[0], 3), y=round(-at_m[1], 3))
