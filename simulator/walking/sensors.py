"""The walking robot's sensors: odometry from legs and IMU, and poses from a localiser that matches lidar sweeps.

Nothing is computed from the true pose: gaps between poses are the localiser's own. Of a mission's sensor faults, a covered
lidar makes the localiser really lost; the others change what it publishes.
"""

import numpy as np

from harness.contracts import observations
from simulator import sensors
from simulator.bodies import BodyState, Floats
from simulator.noise import Streams
from simulator.samples import SampleRing
from simulator.solids import SiteModel
from simulator.walking.body import WalkingBody
from simulator.walking.localiser import Localiser
from simulator.walking.scan_matching import ScanMatcher
from simulator.walking.survey import survey_of

RANGE_NOISE_M = 0.01
REPORT_FIXES = 10
_LIDAR_KEY = 0x4C49444152


class WalkingSensors(sensors.Sensors):
    """As `sensors.Sensors`, read from a body with legs; `localiser` knows whether the robot is lost."""

    def __init__(
        self, streams: Streams, ring: SampleRing, body: WalkingBody, site: SiteModel, *, began: sensors.Fix | None
    ) -> None:
        """`began`: the pose that the robot is said to stand at when it is switched on, None if nobody knows."""
        self._body = body
        self.localiser = Localiser(ScanMatcher(survey_of(site)), began or (0.0, 0.0, 0.0))
        if began is None:
            self.localiser.forget()
        super().__init__(streams, ring, frame=site.frame, map_version=site.map_version)

    def reseed(self, streams: Streams) -> None:
        super().reseed(streams)
        self._body.own.reseed(streams)
        self._lidar = np.random.Generator(np.random.Philox(key=[streams.seed & 0xFFFFFFFF, _LIDAR_KEY]))

    def put_down(self) -> None:
        super().put_down()
        self.localiser.forget()

    @property
    def still(self) -> bool:
        """Only while it takes no steps: the trunk's speed passes through zero in every one of them."""
        return super().still and not self._body.steps

    @property
    def localised(self) -> bool:
        return self.localiser.state == "tracking"

    def _odometry(self, state: BodyState, at_s: float) -> None:
        ring, own = self._ring, self._body.own
        self.odometer = own.odometer
        self._twist = (float(own.twist[0]), float(own.twist[2]))
        x, y, yaw = own.odometer
        seq = ring.newest + 1
        ring.add(
            observations.Odometry(
                seq=seq, at_s=at_s, source="odometry", frame="odom", x_m=x, y_m=y, yaw_rad=yaw,
                v_mps=self._twist[0], w_radps=self._twist[1],
            )
        )  # fmt: skip
        ahead, aside, _ = own.acceleration.tolist()
        ring.add(
            observations.Imu(
                seq=seq + 1, at_s=at_s, source="imu", ax_mps2=ahead, ay_mps2=aside, w_radps=float(own.turning[2])
            )
        )

    def _localise(self, state: BodyState, at_s: float, *, index: int) -> None:
        sweep = None if self.mode == "lost" else self._noisy(self._body.sweep())
        found = self.localiser.update(self.odometer, sweep, at_s)
        if found is None:
            self.fix = None
        else:
            x, y, yaw = found.pose
            self.fix = (x, y + (sensors.BIAS_M if self.mode == "biased" else 0.0), yaw)
            self.confidence = round(0.95 * found.share, 4)
            if index % REPORT_FIXES == 0:
                self._report("localiser fit", found.share, "", at_s)
                self._report("localiser deviation", found.sigma_m, "m", at_s)
        if self.mode != "missing" and (found is not None or self.mode == "stale"):
            self._publish(at_s)

    def _report(self, name: str, value: float, unit: str, at_s: float) -> None:
        ring = self._ring
        ring.add(observations.InstrumentReading(seq=ring.next(), at_s=at_s, source=name, value=value, unit=unit))

    def _noisy(self, sweep: Floats) -> Floats:
        ranges = np.maximum(np.linalg.norm(sweep, axis=1, keepdims=True), 1e-6)
        noisy: Floats = sweep * (1.0 + RANGE_NOISE_M * self._lidar.standard_normal(ranges.shape) / ranges)
        return noisy
