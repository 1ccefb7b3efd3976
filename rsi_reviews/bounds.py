"""Pure: how much a count or a paired difference proves. numpy only; every draw follows from a key."""

import hashlib
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from harness.contracts.values import Value

Floats = NDArray[np.float64]
LEVEL = 0.95
RESAMPLES = 10_000
BLOCK = 250


class Interval(Value):
    """A mean over `n` with its bootstrap bounds, in the unit of what was measured."""

    mean: float
    low: float
    high: float
    n: int


def upper_bound(count: int, trials: int, *, level: float = LEVEL) -> float:
    """The largest share that `count` in `trials` does not refute, one-sided Clopper-Pearson; 1.0 without trials.

    For a count of zero this is 1 - (1 - level) ** (1 / trials), about 3 / trials at 95 %.
    """
    if not 0 <= count <= trials:
        raise ValueError(f"{count} of {trials} is no count")
    if count == trials:
        return 1.0
    if count == 0:
        return -math.expm1(math.log1p(-level) / trials)
    low, high = count / trials, 1.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _at_most(count, trials, middle) > 1.0 - level else (low, middle)
    return high


def _at_most(count: int, trials: int, share: float) -> float:
    """P(X <= count) for X binomial."""
    terms = [
        math.lgamma(trials + 1)
        - math.lgamma(k + 1)
        - math.lgamma(trials - k + 1)
        + k * math.log(share)
        + (trials - k) * math.log1p(-share)
        for k in range(count + 1)
    ]
    peak = max(terms)
    return math.exp(peak) * math.fsum(math.exp(term - peak) for term in terms)


def paired(differences: Mapping[str, Sequence[float]], *, key: str, alpha: float) -> Interval:
    """The mean of paired differences, each stratum resampled by itself, with its two bounds at `alpha` each.

    `differences`: by stratum, one number per pair. The same key draws the same resamples. Raises ValueError if there
    is no pair or a difference is not finite.
    """
    strata = [np.asarray(differences[name], dtype=np.float64) for name in sorted(differences) if differences[name]]
    n = sum(len(one) for one in strata)
    if not n or not all(np.isfinite(one).all() for one in strata):
        raise ValueError("paired differences are missing or not finite")
    sums = np.zeros(RESAMPLES)
    for number, stratum in enumerate(strata):
        sums += _resampled(stratum, key=f"{key}\n{number}")
    low, high = np.quantile(sums / n, [alpha, 1.0 - alpha])
    return Interval(mean=float(sum(one.sum() for one in strata) / n), low=float(low), high=float(high), n=n)


def _resampled(values: Floats, *, key: str) -> Floats:
    """Sums of RESAMPLES resamples of `values`, drawn with replacement."""
    sums, size = np.empty(RESAMPLES), len(values)
    for begin in range(0, RESAMPLES, BLOCK):
        body = hashlib.shake_256(f"{key}\n{begin}".encode()).digest(4 * BLOCK * size)
        draws = np.frombuffer(body, dtype="<u4").reshape(BLOCK, size)
        picks = (draws.astype(np.uint64) * size) >> np.uint64(32)
        sums[begin : begin + BLOCK] = values[picks].sum(axis=1)
    return sums
