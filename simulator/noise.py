"""Draws normal noise keyed by (seed, subsystem, index), so that the same event draws the same number in paired runs."""

import hashlib

import numpy as np

_BLOCK = 1024


class Streams:
    """Standard normal draws. Draw `index` of a subsystem depends on seed, subsystem and index and nothing else."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._blocks: dict[str, tuple[int, list[float]]] = {}
        self._rows: dict[tuple[str, ...], tuple[int, list[tuple[float, ...]]]] = {}

    def normal(self, subsystem: str, index: int) -> float:
        """Draw number `index` (from 0) of N(0, 1)."""
        number, at = divmod(index, _BLOCK)
        held = self._blocks.get(subsystem)
        if held is None or held[0] != number:
            held = (number, self._draw(subsystem, number))
            self._blocks[subsystem] = held
        return held[1][at]

    def normals(self, subsystems: tuple[str, ...], index: int) -> tuple[float, ...]:
        """Draw number `index` of each of these subsystems, in their order."""
        number, at = divmod(index, _BLOCK)
        held = self._rows.get(subsystems)
        if held is None or held[0] != number:
            held = (number, list(zip(*(self._draw(name, number) for name in subsystems), strict=True)))
            self._rows[subsystems] = held
        return held[1][at]

    def _draw(self, subsystem: str, number: int) -> list[float]:
        key = hashlib.sha256(f"{self.seed}\n{subsystem}\n{number}".encode()).digest()
        generator = np.random.Generator(np.random.Philox(int.from_bytes(key[:16])))
        draws: list[float] = generator.standard_normal(_BLOCK).tolist()
        return draws
