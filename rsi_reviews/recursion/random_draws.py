"""Draws the experiment's random numbers: each follows from its key alone, so that every arm meets the same missions."""

import hashlib

SEEDS = 2**31 - 1


def uniform(*key: object) -> float:
    """A number in [0, 1), determined by the key alone."""
    return int.from_bytes(hashlib.sha256("\n".join(map(str, key)).encode()).digest()[:7]) / 2**56


def seed_of(*key: object) -> int:
    """A mission's seed."""
    return 1 + int(uniform("seed", *key) * SEEDS)
