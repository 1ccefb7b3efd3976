"""Finds where to stand to see what was not seen: free places with a clear line to it on the map. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.contracts.exploration import OCCUPIED, GridMap
from harness.contracts.values import Point
from harness.exploration.grid import middle_of
from harness.exploration.paths import Cell, Ways
from harness.projections.floor import Mask, cells_of

SIGHT_M = 6.0
"""Further away than this the floor is seen too flatly to count."""
EVERY = 2
"""Of the cells where the body may stand, every second one in each direction is asked."""
MOST_SEEN = 80
STEP = 0.5
"""Cells between two samples of a line of sight."""


@dataclass(frozen=True)
class Viewpoint:
    """Where to stand: how much of what was wanted can be seen from there, 0 to 1, and how long the way is."""

    at_m: Point
    share: float
    way_m: float


def viewpoints(
    grid: GridMap,
    ways: Ways,
    cells_seen: Sequence[Cell],
    *,
    nearest_m: float = 0.0,
    away_from: Sequence[Point] = (),
    apart_m: float = 0.0,
) -> tuple[Viewpoint, ...]:
    """Reachable places that see any of the wanted cells, the best first: what they show against the way there.

    `nearest_m`: no closer to any wanted cell than this. None lies within `apart_m` of a place of `away_from`.
    """
    cells = [cells_seen[index] for index in np.unique(np.linspace(0, len(cells_seen) - 1, MOST_SEEN).astype(int))]
    standing = [
        (cell, way_m)
        for cell, way_m in ways.reached()
        if cell[0] % EVERY == 0
        and cell[1] % EVERY == 0
        and all(math.dist(middle_of(grid, cell), other) >= apart_m for other in away_from)
    ]
    if not cells or not standing:
        return ()
    places = np.array([cell for cell, _ in standing], dtype=np.float64)
    shares = _visible(cells_of(grid) != OCCUPIED, places, np.array(cells, dtype=np.float64), grid.cell_m, nearest_m)
    found = [
        Viewpoint(at_m=middle_of(grid, cell), share=float(share), way_m=round(way_m, 6))
        for (cell, way_m), share in zip(standing, shares, strict=True)
        if share > 0
    ]
    return tuple(sorted(found, key=lambda one: (-one.share / (one.way_m + SIGHT_M), one.at_m)))


def _visible(
    clear: Mask, places: NDArray[np.float64], cells: NDArray[np.float64], cell_m: float, nearest_m: float
) -> NDArray[np.float64]:
    """The share of the cells that each place sees: within SIGHT_M, with nothing closed on the line before them."""
    along = cells[None, :, :] - places[:, None, :]
    away = np.hypot(along[..., 0], along[..., 1])
    in_range = away * cell_m <= SIGHT_M
    steps = np.arange(0.0, float(np.where(in_range, away, 0.0).max(initial=0.0)), STEP)
    seen = in_range.copy()
    for step in steps:
        share = np.where(away > 0, np.minimum(step / np.maximum(away, 1e-9), 1.0), 0.0)
        at = np.rint(places[:, None, :] + along * share[..., None]).astype(np.int64)
        seen &= clear[at[..., 0], at[..., 1]] | (step >= away - 0.5)
    near = (away * cell_m < nearest_m).any(axis=1)
    shares: NDArray[np.float64] = np.where(near, 0.0, seen.mean(axis=1))
    return shares
