"""Tests whether the body is at rest by a source outside the localiser: this releases leases and confirms stops
(D15)."""

from collections.abc import Iterable

from harness.contracts.observations import AnySample, Odometry
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Value
from harness.verification.geometry import fixes, window_displacement

WINDOW_S = 1.0
LIMIT_M = 0.02
AGE_S = 1.0


class Rest(Value):
    """Measured displacement over the window; `static` is also False when nothing shows it, with the reason."""

    static: bool
    reason: Reason | None
    measured: dict[str, float]


def at_rest(samples: Iterable[AnySample], now_s: float) -> Rest:
    """Displacement by odometry in the last second, in metres. Without recent odometry the body is not at rest."""
    first_s = now_s - AGE_S - WINDOW_S
    track = fixes([one for one in samples if isinstance(one, Odometry) and first_s <= one.at_s <= now_s])
    newest = max((fix.at_s for fix in track), default=0.0)
    if newest < now_s - AGE_S:
        return Rest(static=False, reason=because("no_fresh_odometry"), measured={})
    moved = window_displacement(track, until_s=newest, window_s=WINDOW_S)
    if moved is None:
        return Rest(static=False, reason=because("odometry_too_short"), measured={})
    static = moved < LIMIT_M
    reason = None if static else because("body_moved_in_second", moved_m=moved)
    return Rest(static=static, reason=reason, measured={"displacement_m": moved, "window_s": WINDOW_S})
