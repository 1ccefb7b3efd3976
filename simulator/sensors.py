"""The robot's sensors: noisy readings of the body's true state, each kind with its own random stream."""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from harness.contracts import observations
from harness.contracts.ids import Digest
from simulator.bodies import TICK_S, BodyState, Floats
from simulator.noise import Streams
from simulator.samples import SampleRing

LocaliserMode = Literal["good", "stale", "missing", "frozen", "lost", "biased"]
POSE_TICKS = 2
SCAN_TICKS = 20
BATTERY_TICKS = 100
POSE_NOISE_M = 0.006
YAW_NOISE_RAD = 0.004
BIAS_M = -0.6
SCALE_NOISE = 0.006
TURN_NOISE = 0.004
HEADING_NOISE_RAD = 0.0008
DROPOUT_EVERY_S = 20.0
DROPOUT_LONGEST_S = 0.45
DROPOUT_PERIOD = round(DROPOUT_EVERY_S / (POSE_TICKS * TICK_S))
Fix = tuple[float, float, float]
Store = Callable[[bytes], Digest]
EVERY_TICK = ("odometry-heading", "odometry-reading", "imu-x", "imu-y", "imu-turn")
EVERY_FIX = ("localiser-x", "localiser-y", "localiser-yaw")


class Sensors:
    """Samples every tick. `fix` is the localiser's newest fix for the robot's own controller, published or not.

    The localiser publishes at 10 Hz in `frame`, odometry and IMU at 20 Hz, the lidar at 1 Hz, the battery at 0.2 Hz.
    """

    def __init__(self, streams: Streams, ring: SampleRing, *, frame: str, map_version: str) -> None:
        self._ring = ring
        self._frame, self._map_version = frame, map_version
        self.mode: LocaliserMode = "good"
        self.fix: Fix | None = None
        self.odometer: Fix = (0.0, 0.0, 0.0)
        self.charge = 0.92
        self.confidence = 0.95
        self._held: observations.Pose | None = None
        self._before: Fix | None = None
        self._twist = (0.0, 0.0)
        self.reseed(streams)

    def reseed(self, streams: Streams) -> None:
        """Restart every random stream from its first draw."""
        self._streams, self._tick = streams, 0
        self._scale = 1.0 + SCALE_NOISE * _clipped(streams.normal("odometry-scale", 0))
        self._turn = 1.0 + TURN_NOISE * _clipped(streams.normal("odometry-turn", 0))

    def put_down(self) -> None:
        """The body was carried elsewhere: odometry did not see it, and no old pose is repeated."""
        self._before = self._held = self.fix = None
        self._twist = (0.0, 0.0)

    def sample(self, state: BodyState, at_s: float) -> None:
        """Every sample due this tick, except the lidar."""
        tick = self._tick = self._tick + 1
        self._odometry(state, at_s)
        if tick % POSE_TICKS == 0:
            self._localise(state, at_s, index=tick // POSE_TICKS)
        if tick % BATTERY_TICKS == 0:
            self.charge = max(0.0, self.charge - (0.0004 if abs(state.v_mps) > 0.01 else 0.00005))
            self._ring.add(observations.Battery(seq=self._ring.next(), at_s=at_s, source="battery", charge=self.charge))

    @property
    def still(self) -> bool:
        """Whether odometry shows that the robot stands still."""
        v, w = self._twist
        return abs(v) < 0.01 and abs(w) < 0.02

    @property
    def localised(self) -> bool:
        """Whether the localiser knows where the robot is."""
        return self.mode != "lost"

    @property
    def seed(self) -> int:
        """Of the random streams of the mission under way."""
        return self._streams.seed

    @property
    def scan_due(self) -> bool:
        return self._tick % SCAN_TICKS == 0

    def scan(self, cloud: Floats, at_s: float, store: Store) -> None:
        """Publish one lidar sweep: hits in the body frame with a centimetre of range noise."""
        ranges = np.maximum(np.linalg.norm(cloud, axis=1, keepdims=True), 1e-6)
        generator = np.random.Generator(np.random.Philox(key=[self._streams.seed & 0xFFFFFFFF, self._tick]))
        noisy = cloud * (1.0 + 0.01 * generator.standard_normal(ranges.shape) / ranges)
        body = noisy.astype("<f4").tobytes()
        sample = observations.Scan(
            seq=self._ring.next(), at_s=at_s, source="lidar", frame="body", blob=store(body), points=len(cloud)
        )
        self._ring.add(sample)

    @property
    def twist(self) -> tuple[float, float]:
        """Odometry's newest forward speed and turn rate, m/s and rad/s."""
        return self._twist

    def _odometry(self, state: BodyState, at_s: float) -> None:
        ring = self._ring
        heading, reading, imu_x, imu_y, imu_turn = self._streams.normals(EVERY_TICK, self._tick)
        x0, y0, yaw0 = self._before or (state.x_m, state.y_m, state.yaw_rad)
        self._before = (state.x_m, state.y_m, state.yaw_rad)
        cos, sin = math.cos(yaw0), math.sin(yaw0)
        dx, dy = state.x_m - x0, state.y_m - y0
        forward, lateral = (cos * dx + sin * dy) * self._scale, (cos * dy - sin * dx) * self._scale
        moved = math.hypot(dx, dy)
        turned = math.remainder(state.yaw_rad - yaw0, math.tau) * self._turn
        if moved > 0.0:
            turned += HEADING_NOISE_RAD * math.sqrt(moved) * heading
        x, y, yaw = self.odometer
        middle = yaw + 0.5 * turned
        cos, sin = math.cos(middle), math.sin(middle)
        x, y = x + forward * cos - lateral * sin, y + forward * sin + lateral * cos
        self.odometer = (x, y, math.remainder(yaw + turned, math.tau))
        v, w = forward / TICK_S, turned / TICK_S
        ahead = (v - self._twist[0]) / TICK_S
        self._twist = (v, w)
        jitter, seq = 0.0003 * reading, ring.newest + 1
        ring.add(
            observations.Odometry(
                seq=seq, at_s=at_s, source="odometry", frame="odom", x_m=x + jitter, y_m=y - jitter,
                yaw_rad=self.odometer[2], v_mps=v, w_radps=w,
            )
        )  # fmt: skip
        rough = 0.03 + 0.3 * abs(v)
        ring.add(
            observations.Imu(
                seq=seq + 1, at_s=at_s, source="imu", ax_mps2=ahead + rough * imu_x,
                ay_mps2=v * w + rough * imu_y, w_radps=state.w_radps + 0.004 * imu_turn,
            )
        )  # fmt: skip

    def _localise(self, state: BodyState, at_s: float, *, index: int) -> None:
        if self.mode == "lost" or self._dropped(index):
            self.fix = None
            if self.mode != "stale":
                return
        else:
            noise_x, noise_y, noise_yaw = self._streams.normals(EVERY_FIX, index)
            bias_m = BIAS_M if self.mode == "biased" else 0.0
            self.fix = (
                state.x_m + POSE_NOISE_M * noise_x,
                state.y_m + POSE_NOISE_M * noise_y + bias_m,
                math.remainder(state.yaw_rad + YAW_NOISE_RAD * noise_yaw, math.tau),
            )
        if self.mode != "missing":
            self._publish(at_s)

    def _publish(self, at_s: float) -> None:
        held, seq = self._held, self._ring.next()
        if held is not None and self.mode in ("stale", "frozen"):
            stamp = held.at_s if self.mode == "stale" else at_s
            pose = observations.Pose(
                seq=seq, at_s=stamp, source="localiser", frame=held.frame, map_version=held.map_version,
                x_m=held.x_m, y_m=held.y_m, yaw_rad=held.yaw_rad, confidence=held.confidence,
            )  # fmt: skip
        elif self.fix is not None:
            x, y, yaw = self.fix
            pose = observations.Pose(
                seq=seq, at_s=at_s, source="localiser", frame=self._frame, map_version=self._map_version,
                x_m=x, y_m=y, yaw_rad=yaw, confidence=self.confidence,
            )  # fmt: skip
            self._held = pose
        else:
            return
        self._ring.add(pose)

    def _dropped(self, index: int) -> bool:
        """Short gaps: about one in DROPOUT_EVERY_S, each shorter than half a second."""
        number, at = divmod(index, DROPOUT_PERIOD)
        if at < DROPOUT_PERIOD // 2:
            return False
        uniform = 0.5 * (1.0 + math.erf(self._streams.normal("dropout", number) / math.sqrt(2)))
        length = 1 + int(uniform * (DROPOUT_LONGEST_S / (POSE_TICKS * TICK_S) - 1))
        begins = DROPOUT_PERIOD // 2 + int(uniform * (DROPOUT_PERIOD // 2 - length - 1))
        return begins <= at < begins + length


def _clipped(value: float) -> float:
    return max(-1.5, min(1.5, value))
