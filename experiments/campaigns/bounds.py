"""Pure: how much a count proves. The upper Clopper-Pearson bound of a share, by the regularised incomplete beta."""

import math

LEVEL = 0.95
ITERATIONS = 300
TINY = 1e-300


def upper_bound(count: int, trials: int, *, level: float = LEVEL) -> float:
    """The largest share of events that `count` in `trials` does not refute, one-sided; 1.0 without trials.

    For a count of zero this is 1 - (1 - level) ** (1 / trials), about 3 / trials at 95 %.
    """
    if count < 0 or count > trials:
        raise ValueError(f"{count} of {trials} is no count")
    if count == trials:
        return 1.0
    if count == 0:
        return -math.expm1(math.log1p(-level) / trials)
    low, high = count / trials, 1.0
    for _ in range(ITERATIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if incomplete_beta(count + 1, trials - count, middle) < level else (low, middle)
        if high - low <= 1e-15:
            break
    return high


def incomplete_beta(a: float, b: float, x: float) -> float:
    """I_x(a, b), the regularised incomplete beta function, for a, b > 0 and x in [0, 1] (continued fraction)."""
    if x <= 0.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x))
    if x < (a + 1.0) / (a + b + 2.0):
        return front * _fraction(a, b, x) / a
    return 1.0 - front * _fraction(b, a, 1.0 - x) / b


def _fraction(a: float, b: float, x: float) -> float:
    """Lentz's method."""
    c, d = 1.0, 1.0 / _kept(1.0 - (a + b) * x / (a + 1.0))
    value = d
    for m in range(1, ITERATIONS + 1):
        for term in (
            m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
        ):
            d = 1.0 / _kept(1.0 + term * d)
            c = _kept(1.0 + term / c)
            value *= c * d
        if abs(c * d - 1.0) < 1e-14:
            break
    return value


def _kept(value: float) -> float:
    return value if abs(value) > TINY else TINY
