"""Draws numbers from a seed and a name, so that one mission of a campaign can be reproduced by itself. Pure."""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def uniform(seed: int, *name: object) -> float:
    """A number in [0, 1) that depends on the seed, the name and nothing else."""
    key = hashlib.sha256("\n".join((str(seed), *map(str, name))).encode()).digest()
    return int.from_bytes(key[:7]) / 2**56


def between(seed: int, low: float, high: float, *name: object) -> float:
    """A number in [low, high), rounded to milliseconds or millimetres."""
    return round(low + (high - low) * uniform(seed, *name), 3)


def one_of(seed: int, choices: Sequence[T], *name: object) -> T:
    """One of the choices, each as likely."""
    return choices[int(uniform(seed, *name) * len(choices))]
