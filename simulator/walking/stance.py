"""Holds the trunk of a standing robot upright by its IMU: legs lengthen where the trunk is low and shorten where it is
high.

A robot stops in the middle of a step, and its feet hold where they are: without this the trunk stays a few degrees off.
"""

import numpy as np
from numpy.typing import NDArray

from simulator.walking.legs import LINK_M

SMOOTH_S, PULL_PER_S = 0.1, 3.0
"""Gravity is smoothed over so long, and so large a share of the tilt is taken out in a second."""
UPRIGHT_RAD = 0.003
"""A smaller tilt is left: the legs do not move for what the IMU's noise shows."""
MOST_RAD = 0.1
"""The legs take out no more than this."""
Floats = NDArray[np.float64]


class UprightStance:
    """The joint angles to add to those of standing; they change until the IMU shows the trunk upright."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """The robot begins to stand: nothing is known of its tilt."""
        self._down: Floats | None = None
        self._lean = np.zeros(2)

    def angles(self, pose: Floats, down: Floats, feet_m: Floats, *, within_s: float) -> Floats:
        """What to add to `pose` (12,), radians. To be asked once every `within_s`.

        `down`: the unit vector of gravity in the trunk frame; `feet_m`: the feet in it, shape (4, 3), metres.
        """
        before = down if self._down is None else self._down
        self._down = before + within_s / (SMOOTH_S + within_s) * (down - before)
        tilt = self._down[:2]
        if float(np.hypot(*tilt)) > UPRIGHT_RAD:
            self._lean = np.clip(self._lean + PULL_PER_S * within_s * tilt, -MOST_RAD, MOST_RAD)
        return longer_legs(pose, feet_m[:, :2] @ self._lean)


def longer_legs(pose: Floats, metres: Floats) -> Floats:
    """The change of joint angles (12,), radians, that makes each leg of `pose` so much longer, shape (4,), by small
    angles: the feet move down in the trunk frame, neither ahead nor aside."""
    _, thigh, calf = pose.reshape(4, 3).T
    down_thigh, down_calf = -LINK_M * (np.sin(thigh) + np.sin(thigh + calf)), -LINK_M * np.sin(thigh + calf)
    ahead_thigh, ahead_calf = -LINK_M * (np.cos(thigh) + np.cos(thigh + calf)), -LINK_M * np.cos(thigh + calf)
    share = -ahead_calf / ahead_thigh
    change = metres / (down_thigh * share + down_calf)
    return np.stack([np.zeros(4), share * change, change], axis=1).reshape(12)
