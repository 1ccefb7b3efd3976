"""Computes the result of one mission under one arm, and of many: counts with exact bounds, means with bootstrap
intervals. Pure.
"""

import hashlib
import math
from collections.abc import Callable, Sequence

import msgspec
import numpy as np
import scipy

from harness.contracts.values import Count, Name, NonNegative, Value

LEVEL = 0.95
DRAWS = 2000


class JudgedMission(Value):
    """One mission of one cell, as the adjudicator and the clock saw it. Times in mission seconds, CPU in seconds.

    `recovery`: how the mission ended where something had to be recovered: not needed, recovered, false success, handed
    off, failed, or missed, where nobody declared what was truly done.
    """

    arm: Name
    condition: Name
    mission: Name
    seed: int
    status: Name
    success: bool
    truly_done: bool
    declared: bool
    contract_false: Count
    epistemic_false: Count
    unsupported: Count
    duplicate_starts: Count
    false_rejections: Count
    missed: bool
    handoffs: Count
    spent: Count
    recovery: Name
    claims: Count
    starts: Count
    mission_s: NonNegative
    cpu_s: NonNegative
    notes: tuple[str, ...] = ()


class ConfidenceInterval(Value):
    """A figure with its 95 % interval; `n` is how many missions it rests on."""

    value: float
    low: float
    high: float
    n: Count


class Cell(Value):
    """One row of the published tables: an arm under a condition. Rates are shares of missions.

    Rates have Clopper-Pearson intervals, `success_wilson` Wilson's as well; `_mean` figures have percentile bootstrap
    intervals. `command` runs the row again.
    """

    arm: Name
    condition: Name
    n: Count
    success: ConfidenceInterval
    success_wilson: ConfidenceInterval
    contract_false: ConfidenceInterval
    epistemic_false: ConfidenceInterval
    duplicate_starts: ConfidenceInterval
    false_rejection: ConfidenceInterval
    missed: ConfidenceInterval
    handoff: ConfidenceInterval
    unsupported: ConfidenceInterval
    spent_mean: ConfidenceInterval
    mission_s_mean: ConfidenceInterval
    cpu_per_stage_s_mean: ConfidenceInterval
    recovery: dict[str, int]
    command: str
    seeds: str


def cell(rows: Sequence[JudgedMission], *, command: str) -> Cell:
    """One row of the tables; `rows` are of one arm and one condition."""
    first, n = rows[0], len(rows)
    ends: dict[str, int] = {}
    for row in rows:
        ends[row.recovery] = ends.get(row.recovery, 0) + 1

    def rate(holds: Callable[[JudgedMission], bool]) -> ConfidenceInterval:
        return exact(sum(holds(row) for row in rows), n)

    def mean(values: Callable[[JudgedMission], float], name: str) -> ConfidenceInterval:
        return bootstrap([values(row) for row in rows], key=f"{first.arm}/{first.condition}/{name}")

    return Cell(
        arm=first.arm,
        condition=first.condition,
        n=n,
        success=rate(lambda row: row.success),
        success_wilson=wilson(sum(row.success for row in rows), n),
        contract_false=rate(lambda row: row.contract_false > 0),
        epistemic_false=rate(lambda row: row.epistemic_false > 0),
        duplicate_starts=rate(lambda row: row.duplicate_starts > 0),
        false_rejection=rate(lambda row: row.false_rejections > 0),
        missed=rate(lambda row: row.missed),
        handoff=rate(lambda row: row.handoffs > 0),
        unsupported=rate(lambda row: row.unsupported > 0),
        spent_mean=mean(lambda row: float(row.spent), "spent"),
        mission_s_mean=mean(lambda row: row.mission_s, "mission_s"),
        cpu_per_stage_s_mean=mean(lambda row: row.cpu_s / max(row.starts, 1), "cpu"),
        recovery=dict(sorted(ends.items())),
        command=command,
        seeds=f"{min(row.seed for row in rows)}..{max(row.seed for row in rows)}",
    )


def exact(count: int, n: int, *, level: float = LEVEL) -> ConfidenceInterval:
    """A share with its two-sided Clopper-Pearson interval; for no missions the interval is the whole range."""
    if not 0 <= count <= n:
        raise ValueError(f"{count} of {n} is no count")
    if not n:
        return ConfidenceInterval(value=0.0, low=0.0, high=1.0, n=0)
    tail = (1.0 - level) / 2.0
    low = scipy.special.betaincinv(count, n - count + 1, tail) if count else 0.0
    high = scipy.special.betaincinv(count + 1, n - count, 1.0 - tail) if count < n else 1.0
    return ConfidenceInterval(value=count / n, low=float(low), high=float(high), n=n)


def wilson(count: int, n: int) -> ConfidenceInterval:
    """A share with Wilson's score interval at 95 %."""
    if not n:
        return ConfidenceInterval(value=0.0, low=0.0, high=1.0, n=0)
    z, share = 1.959963984540054, count / n
    scale = 1.0 + z * z / n
    middle = (share + z * z / (2 * n)) / scale
    half = z / scale * math.sqrt(share * (1.0 - share) / n + z * z / (4 * n * n))
    return ConfidenceInterval(value=share, low=max(0.0, middle - half), high=min(1.0, middle + half), n=n)


def bootstrap(values: Sequence[float], *, key: str, level: float = LEVEL) -> ConfidenceInterval:
    """A mean with its percentile bootstrap interval; the draws depend on `key` and nothing else."""
    if not values:
        return ConfidenceInterval(value=0.0, low=0.0, high=0.0, n=0)
    sample = np.asarray(values, dtype=float)
    seed = int.from_bytes(hashlib.sha256(key.encode()).digest()[:8])
    picks = _picks(seed, len(sample))
    means = sample[picks].mean(axis=1)
    tail = 100.0 * (1.0 - level) / 2.0
    low, high = np.percentile(means, [tail, 100.0 - tail])
    return ConfidenceInterval(value=float(sample.mean()), low=float(low), high=float(high), n=len(sample))


def _picks(seed: int, n: int) -> "np.ndarray[tuple[int, int], np.dtype[np.int64]]":
    """DRAWS times n indices below n, from a counter hashed with the seed; no random generator is used."""
    counters = np.arange(DRAWS * n, dtype=np.uint64) + np.uint64(seed)
    mixed = (counters ^ (counters >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed ^= mixed >> np.uint64(31)
    return (mixed % np.uint64(n)).astype(np.int64).reshape(DRAWS, n)


def encoded(row: JudgedMission) -> bytes:
    """One line of the results file."""
    return msgspec.json.encode(row)
