"""Makes the round numbers that stand on the axis of a plot."""

from math import ceil, floor, log10

TICKS = 5


def ticks(low: float, high: float, *, about: int = TICKS) -> tuple[float, ...]:
    """Round values between these two, about so many."""
    rough = (high - low or 1.0) / about
    power = 10.0 ** floor(log10(rough))
    step = next(one * power for one in (1.0, 2.0, 5.0, 10.0) if one * power >= rough)
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    return tuple(round(number * step, 10) for number in range(first, last + 1))
