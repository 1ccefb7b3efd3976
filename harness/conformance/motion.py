"""Measures a body's motion by the robot's own odometry, never by its localiser or the provider's report."""

import math
from collections.abc import Callable, Sequence
from statistics import median

from harness.contracts.errors import ProviderFailed
from harness.contracts.observations import AnySample, Odometry
from harness.contracts.protocol import Observations
from harness.contracts.reasons import because
from harness.contracts.values import Value
from harness.supervisor.observations import MOST_BATCHES
from harness.supervisor.standstill import LIMIT_M, WINDOW_S
from harness.verification.geometry import Fix, window_displacement

TURN_LIMIT_RAD = 0.03
UNDER_WAY_MPS, UNDER_WAY_RADPS = 0.2, 0.5
BATCH = 5000
_EDGE = 3


class Motion(Value):
    """What odometry shows of one window: metres and radians, and whether that is standing still."""

    displacement_m: float
    turned_rad: float

    @property
    def still(self) -> bool:
        return self.displacement_m < LIMIT_M and self.turned_rad < TURN_LIMIT_RAD


class SampleLog:
    """The robot's samples since this row began, in order of arrival."""

    def __init__(self, observations: Callable[[int, int], Observations] | None) -> None:
        self._observations = observations
        self._after = 0
        self.samples: list[AnySample] = []
        self.collect()
        self.samples.clear()

    @property
    def present(self) -> bool:
        """Whether there is a robot that observes."""
        return self._observations is not None

    def collect(self) -> Sequence[AnySample]:
        """Read on; returns everything since the row began. Raises ProviderFailed if the batches do not end."""
        for number in range(MOST_BATCHES + 1):
            if self._observations is None:
                break
            if number == MOST_BATCHES:
                raise ProviderFailed(because("observations_endless", batches=MOST_BATCHES), where="/observations")
            batch = self._observations(self._after, BATCH)
            fresh = [sample for sample in batch.samples if sample.seq > self._after]
            self.samples.extend(fresh)
            self._after = max((sample.seq for sample in fresh), default=self._after)
            if len(fresh) < BATCH:
                break
        return self.samples

    def moving(self) -> bool:
        """Whether the newest odometry is motion beyond doubt."""
        newest = next((s for s in reversed(self.collect()) if isinstance(s, Odometry)), None)
        return newest is not None and (abs(newest.v_mps) > UNDER_WAY_MPS or abs(newest.w_radps) > UNDER_WAY_RADPS)

    def motion(self, until_s: float) -> Motion | None:
        """Motion in the window that ends at `until_s`; None if odometry does not cover it."""
        covered = [s for s in self.collect() if isinstance(s, Odometry) and s.at_s <= until_s]
        fixes = [Fix(s.at_s, s.x_m, s.y_m) for s in covered]
        if not fixes or fixes[-1].at_s < until_s - WINDOW_S / 2:
            return None
        moved = window_displacement(fixes, until_s=fixes[-1].at_s, window_s=WINDOW_S)
        if moved is None:
            return None
        yaws = [s.yaw_rad for s in covered if s.at_s >= fixes[-1].at_s - WINDOW_S]
        turned = math.remainder(median(yaws[-_EDGE:]) - median(yaws[:_EDGE]), math.tau)
        return Motion(displacement_m=moved, turned_rad=abs(turned))
