"""Leg kinematics of the Go2: where its feet are from its joint angles, and how fast its trunk moves over standing feet.

Trunk frame: x ahead, y left, z up. Joints of each leg: abduction, thigh, calf. Arrays have one row for each of LEGS.
"""

import numpy as np
from numpy.typing import NDArray

LEGS = ("FR", "FL", "RR", "RL")
LINK_M, ASIDE_M, FOOT_M = 0.213, 0.0955, 0.022
_FOOT_X_M = -0.002
_HIPS = np.array([[0.1934, -0.0465, 0.0], [0.1934, 0.0465, 0.0], [-0.1934, -0.0465, 0.0], [-0.1934, 0.0465, 0.0]])
_SIDES = np.array([-1.0, 1.0, -1.0, 1.0])
Floats = NDArray[np.float64]


class FootMotion:
    """The lowest points of the feet and their velocities in the trunk frame, shape (4, 3), metres and m/s."""

    def __init__(self, angles: Floats, rates: Floats, down: Floats) -> None:
        """`down`: the unit vector of gravity in the trunk frame, from the IMU."""
        side, thigh, calf = angles.reshape(4, 3).T
        bent = thigh + calf
        x_calf = _FOOT_X_M * np.cos(bent) - LINK_M * np.sin(bent)
        z_calf = -_FOOT_X_M * np.sin(bent) - LINK_M * np.cos(bent)
        x, z = x_calf - LINK_M * np.sin(thigh), z_calf - LINK_M * np.cos(thigh)
        y, cos, sin = _SIDES * ASIDE_M, np.cos(side), np.sin(side)
        centres = np.stack([x, y * cos - z * sin, y * sin + z * cos], axis=1)
        side_rate, thigh_rate, calf_rate = rates.reshape(4, 3).T
        x_rate = z * thigh_rate + z_calf * calf_rate
        z_rate = -x * thigh_rate - x_calf * calf_rate
        y_rate = -z_rate * sin - centres[:, 2] * side_rate
        moving = np.stack([x_rate, y_rate, z_rate * cos + centres[:, 1] * side_rate], axis=1)
        rolling = np.stack([side_rate, cos * (thigh_rate + calf_rate), sin * (thigh_rate + calf_rate)], axis=1)
        self.points_m: Floats = _HIPS + centres + FOOT_M * down
        self.velocities_mps: Floats = moving + np.cross(rolling, FOOT_M * down)

    def trunk_velocity(self, turning: Floats, standing: NDArray[np.bool_]) -> Floats | None:
        """Velocity of the trunk in its own frame if the standing feet do not slip; None where none stands."""
        if not standing.any():
            return None
        velocities = -(self.velocities_mps + np.cross(turning, self.points_m))
        mean: Floats = velocities[standing].mean(axis=0)
        return mean

    def height_m(self, down: Floats, standing: NDArray[np.bool_]) -> float | None:
        """Height of the trunk's origin above the feet that stand, along gravity."""
        return float((self.points_m[standing] @ down).mean()) if standing.any() else None
