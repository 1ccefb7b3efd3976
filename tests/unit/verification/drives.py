"""Drives as sensors see them: a body that stands, goes along a route and stands again, and its sealed samples."""

import math
import random
from dataclasses import dataclass

from msgspec.structs import replace

from harness.contracts.observations import AnySample, Imu, Odometry, Pose, Trajectory
from harness.contracts.values import Point

BEGAN_S = 1000.0
ROUTE: tuple[Point, ...] = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0))


@dataclass(frozen=True)
class Drive:
    """A body that stands, drives `route` to `until_m` of it, and stands again; what its sensors publish.

    `freeze_after_m`: the localiser repeats its pose with fresh stamps; `restamp_after_m`: with the old stamp;
    `silent_after_m`: not at all (0 = from the very start).
    """

    route: tuple[Point, ...] = ROUTE
    from_s: float = BEGAN_S
    from_m: float = 0.0
    until_m: float = math.inf
    speed_mps: float = 0.5
    before_s: float = 2.0
    after_s: float = 3.0
    freeze_after_m: float = math.inf
    restamp_after_m: float = math.inf
    silent_after_m: float = math.inf
    odometry: bool = True
    imu: bool = True
    noise_m: float = 0.006
    seed: int = 1

    @property
    def length_m(self) -> float:
        return min(self.until_m, math.fsum(math.dist(a, b) for a, b in zip(self.route, self.route[1:], strict=False)))

    @property
    def stopped_s(self) -> float:
        """When the body came to rest."""
        return self.from_s + self.before_s + (self.length_m - self.from_m) / self.speed_mps

    @property
    def until_s(self) -> float:
        return self.stopped_s + self.after_s

    def samples(self) -> tuple[AnySample, ...]:
        """In order of arrival: odometry and IMU at 20 Hz, poses at 10 Hz, `seq` rising."""
        chance = random.Random(self.seed)
        found: list[AnySample] = []
        held: Pose | None = None
        for tick in range(round((self.until_s - self.from_s) * 20) + 1):
            at_s = self.from_s + tick / 20
            moved_m, (x, y, yaw) = self._body(at_s)
            v = self.speed_mps if self.from_m < moved_m < self.length_m else 0.0
            seq = len(found) + 1 + round(self.from_s)
            if self.odometry:
                cos, sin = math.cos(0.7), math.sin(0.7)
                found.append(
                    Odometry(
                        seq=seq, at_s=at_s, source="odometry", frame="odom", x_m=1.003 * (x * cos - y * sin) + 9.0,
                        y_m=1.003 * (x * sin + y * cos), yaw_rad=math.remainder(yaw + 0.7, math.tau), v_mps=v,
                        w_radps=0.0,
                    )
                )  # fmt: skip
            if self.imu:
                noise = chance.gauss(0.0, 0.02)
                found.append(Imu(seq=seq + 1, at_s=at_s, source="imu", ax_mps2=noise, ay_mps2=-noise, w_radps=0.0))
            if tick % 2 or moved_m > self.silent_after_m or (self.silent_after_m == 0.0):
                continue
            dx, dy = chance.gauss(0.0, self.noise_m), chance.gauss(0.0, self.noise_m)
            pose = Pose(
                seq=seq + 2, at_s=at_s, source="localiser", frame="map", map_version="site-1", x_m=x + dx, y_m=y + dy,
                yaw_rad=yaw, confidence=0.95,
            )  # fmt: skip
            if held is not None and moved_m > self.freeze_after_m:
                pose = replace(held, seq=pose.seq, at_s=at_s)
            elif held is not None and moved_m > self.restamp_after_m:
                pose = replace(held, seq=pose.seq)
            else:
                held = pose
            found.append(pose)
        return tuple(found)

    def trajectory(self) -> Trajectory:
        return sealed(self.samples())

    def _body(self, at_s: float) -> tuple[float, tuple[float, float, float]]:
        moving_s = max(0.0, at_s - self.from_s - self.before_s)
        arc = min(self.from_m + moving_s * self.speed_mps, self.length_m)
        left = arc
        for (ax, ay), (bx, by) in zip(self.route, self.route[1:], strict=False):
            leg = math.dist((ax, ay), (bx, by))
            heading = math.atan2(by - ay, bx - ax)
            if left <= leg:
                return arc, (ax + (bx - ax) * left / leg, ay + (by - ay) * left / leg, heading)
            left -= leg
        return arc, (*self.route[-1], heading)


def sealed(samples: tuple[AnySample, ...]) -> Trajectory:
    """Samples as the supervisor seals them."""
    ordered = sorted(samples, key=lambda sample: (sample.at_s, sample.seq))
    return Trajectory(
        poses=tuple(one for one in ordered if isinstance(one, Pose)),
        odometry=tuple(one for one in ordered if isinstance(one, Odometry)),
        imu=tuple(one for one in ordered if isinstance(one, Imu)),
    )
