"""The controller's own pose estimate: odometry between fixes, corrected by each fix."""

import math

from simulator.sensors import Fix

PULL = 0.25


class Estimate:
    """Planar pose in the map frame, metres and radians. Starts at the pose the robot was switched on at."""

    def __init__(self, pose: Fix) -> None:
        self.x_m, self.y_m, self.yaw_rad = pose
        self._odometer: Fix = (0.0, 0.0, 0.0)

    def begin(self, odometer: Fix) -> None:
        """Count odometry from this reading on."""
        self._odometer = odometer

    def update(self, odometer: Fix, fix: Fix | None) -> None:
        """Add the odometer's last step; pull towards a fix, and jump to one that is far off."""
        x0, y0, yaw0 = self._odometer
        self._odometer = odometer
        turn = self.yaw_rad - yaw0
        cos, sin = math.cos(turn), math.sin(turn)
        dx, dy = odometer[0] - x0, odometer[1] - y0
        self.x_m += cos * dx - sin * dy
        self.y_m += sin * dx + cos * dy
        self.yaw_rad += odometer[2] - yaw0
        if fix is not None:
            pull = 1.0 if math.hypot(fix[0] - self.x_m, fix[1] - self.y_m) > 0.5 else PULL
            self.x_m += pull * (fix[0] - self.x_m)
            self.y_m += pull * (fix[1] - self.y_m)
            self.yaw_rad += pull * math.remainder(fix[2] - self.yaw_rad, math.tau)
        self.yaw_rad = math.remainder(self.yaw_rad, math.tau)
