"""Measures what a map of the floor shows: its free floor, and how much of its reachable floor was seen. Pure."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from harness.contracts.exploration import FREE, OCCUPIED, UNKNOWN, GridMap
from harness.contracts.values import NonNegative, Share, Value

Cells = NDArray[np.uint8]
Mask = NDArray[np.bool_]
SPECK = 4
"""So many of its eight neighbours are free around an unknown cell that lies between two rays."""
BESIDE_CELLS = 2
"""Regions that border on each other leave a strip between them, as wide as a wall."""
STEPS = tuple(
    (down, right, math.hypot(down, right)) for down in (-1, 0, 1) for right in (-1, 0, 1) if (down, right) != (0, 0)
)


class Coverage(Value):
    """Square metres of the region's floor: seen; not seen though nothing closes the way to it; closed off, not seen.

    `share` is what was seen of the floor that can be reached.
    """

    seen_m2: NonNegative
    unseen_m2: NonNegative
    closed_m2: NonNegative

    @property
    def share(self) -> Share:
        """0 for a map that shows nothing."""
        whole = self.seen_m2 + self.unseen_m2
        return self.seen_m2 / whole if whole else 0.0


def coverage(grid: GridMap) -> Coverage:
    """What the map shows of its region."""
    region, seen = region_of(grid), free_floor(grid)
    wide, joined = _reachable(grid)
    area = grid.cell_m**2
    return Coverage(
        seen_m2=float(np.count_nonzero(joined & seen & region)) * area,
        unseen_m2=float(np.count_nonzero(joined & wide & region)) * area,
        closed_m2=float(np.count_nonzero(wide & region & ~joined)) * area,
    )


def unseen(grid: GridMap) -> Mask:
    """The floor of the region that can be reached and was not seen."""
    wide, joined = _reachable(grid)
    found: Mask = joined & wide & region_of(grid)
    return found


def _reachable(grid: GridMap) -> tuple[Mask, Mask]:
    """Unknown floor, and the floor that can be reached, seen or not.

    Floor counts as reachable where it joins the largest seen part of the floor without crossing anything that was seen
    closed; a way may lead BESIDE_CELLS outside the region. Unknown floor counts from three cells across: what is
    narrower lies between two rays, or inside a piece of furniture.
    """
    seen = free_floor(grid)
    unknown = widened(region_of(grid), BESIDE_CELLS) & ~seen & (cells_of(grid) != OCCUPIED)
    wide = unknown & widened(~widened(~unknown, 1), 1)
    return wide, _largest_part(seen, seen | wide)


def _largest_part(seen: Mask, floor: Mask) -> Mask:
    """The connected part of the floor that holds most of what was seen."""
    parts, count = scipy.ndimage.label(floor)
    sizes = np.bincount(np.asarray(parts)[seen], minlength=count + 1)
    part: Mask = (np.asarray(parts) == int(sizes.argmax())) & floor
    return part


def cells_of(grid: GridMap) -> Cells:
    """Rows x columns, a view that cannot be written to."""
    return np.frombuffer(grid.cells, dtype=np.uint8).reshape(grid.rows, grid.columns)


def region_of(grid: GridMap) -> NDArray[np.bool_]:
    """The cells that are to be seen, rows x columns."""
    if not grid.region:
        return np.ones((grid.rows, grid.columns), bool)
    region: Mask = np.frombuffer(grid.region, dtype=np.uint8).reshape(grid.rows, grid.columns) == 1
    return region


def free_floor(grid: GridMap) -> Mask:
    """What the lidar saw free, and the specks between its rays: unknown cells with free floor around most of them."""
    cells = cells_of(grid)
    free: Mask = cells == FREE
    around = sum(_shifted(free, down, right).astype(np.int64) for down, right, _ in STEPS)
    floor: Mask = free | ((cells == UNKNOWN) & (around >= SPECK) & ~widened(cells == OCCUPIED, 1))
    return floor


def _shifted(mask: Mask, down: int, right: int) -> Mask:
    found = np.zeros_like(mask)
    rows, columns = mask.shape
    into = (slice(max(0, down), rows + min(0, down)), slice(max(0, right), columns + min(0, right)))
    out = (slice(max(0, -down), rows + min(0, -down)), slice(max(0, -right), columns + min(0, -right)))
    found[into] = mask[out]
    return found


def widened(mask: Mask, cells: float) -> Mask:
    """Every cell within so many cells of the mask, as a disc."""
    found = np.zeros_like(mask)
    reach = math.floor(cells)
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            if math.hypot(down, right) <= cells:
                found |= _shifted(mask, down, right)
    return found
