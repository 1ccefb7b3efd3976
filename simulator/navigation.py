"""Follows a route by pure pursuit with a lookahead, declares arrival, and gives up when there is no progress.

`RouteFollower` stays on the route and stops where its lidar sees it blocked. `CarefulPlanner` leaves the route to get
round an obstacle that its lidar shows, where a gap is wide enough.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from msgspec.structs import replace

from harness.contracts.reasons import Reason, because
from harness.contracts.values import Point, Value, encode
from simulator.bodies import BRAKING_MPS2, LIDAR_REACH_M, Floats, Velocity
from simulator.local_map import LocalMap
from simulator.routes import RouteLine
from simulator.skill_interface import Draft, Outcome, Perception, Step

NO_PROGRESS_S = 10.0
PROGRESS_M = 0.2
TURN_CAP_RADPS = 1.0
DEPARTURE_M = 0.8
SEARCH_M = 1.5
SWATH_M = 0.3
LOOK_S = 0.4
APPROACH_TOLERANCE_M = 0.3
AIM_RAD, FACING_RAD = 0.012, 0.035
"""A turn ends within AIM_RAD of the heading; one that is off by less than FACING_RAD is not begun."""
TURN_WITHIN_S = 20.0
NARROW_M, ALIGNED_RAD = 0.6, 0.2
"""From rest in a place that is narrower, a body turns to within ALIGNED_RAD of its way before it drives."""
LAST_SEEN = 40
REJOIN_M = tuple(np.arange(0.6, 3.5, 0.2).tolist())
"""Where a detour may rejoin the route, metres ahead: early where it is clear, else as far on as the map shows."""
AHEAD = np.radians(np.linspace(-75.0, 75.0, 51))
AROUND = np.radians(np.linspace(-180.0, 180.0, 120, endpoint=False))


class Leg(Value):
    """What a navigation request asks for: a route in the map frame, where on it to begin, and limits.

    `approach_m` is the way from the body to where the leg begins, empty where it stands there. `reachable` is false
    where no way leads to the route. `heading_rad`: the heading to turn to at the target, if one is wanted.
    `keep_out_m`: polygons of floor that no detour may cross.
    """

    route_m: tuple[Point, ...]
    target_m: Point
    tolerance_m: float
    speed_cap_mps: float
    lookahead_m: float
    begin_m: float
    approach_m: tuple[Point, ...] = ()
    reachable: bool = True
    heading_rad: float | None = None
    keep_out_m: tuple[tuple[Point, ...], ...] = ()


class ArrivalEstimate(Value):
    """What an arrival is declared by: the target, and the last estimates as (at_s, x_m, y_m, yaw_rad) in the map."""

    target_m: Point
    distance_m: float
    poses: tuple[tuple[float, float, float, float], ...]


class RouteFollower:
    """The cheap navigator: first to the route on the way planned on its map, then along the route or not at all."""

    def __init__(self, leg: Leg) -> None:
        self._leg = leg
        self._approach = self._follower_to(leg.approach_m) if len(leg.approach_m) > 1 else None
        self.route = RouteLine(leg.route_m)
        self._at_m = self._marked_m = leg.begin_m
        self._marked_s: float | None = None
        self._off_m = math.inf
        self._arrived_s: float | None = None
        self._departed_s: float | None = None
        self._looked_s = -math.inf
        self._held: Reason | None = None
        self._turning = False
        self._aligning = False
        self._seen: deque[tuple[float, float, float, float]] = deque(maxlen=LAST_SEEN)

    @property
    def begin_m(self) -> float:
        """Arc length where this attempt began."""
        return self._leg.begin_m

    @property
    def at_m(self) -> float:
        """Arc length reached so far."""
        return self._at_m

    @property
    def remaining_m(self) -> float:
        return max(self.route.length_m - self._at_m, 0.0)

    @property
    def share(self) -> float:
        return min(1.0, self._at_m / self.route.length_m) if self.route.length_m > 0 else 1.0

    def resume(self, at_s: float) -> None:
        if self._approach is not None:
            self._approach.resume(at_s)  # progress along the route itself is watched from where it begins
        else:
            self._marked_s = at_s

    def step(self, perception: Perception) -> Step:
        """Steer, stop in front of an obstacle, settle at the goal, give up after NO_PROGRESS_S."""
        self._seen.append((perception.at_s, perception.x_m, perception.y_m, perception.yaw_rad))
        if not self._leg.reachable:
            return Step(outcome=self._failed("route_not_reachable", because("no_way_to_route")))
        if self._approach is not None:
            return self._come_near(self._approach, perception)
        self._follow(perception)
        if self._arrived_s is not None:
            return self._settle(perception, self._arrived_s)
        if self._near(perception):
            self._arrived_s = perception.at_s
            return Step()
        if perception.at_s - self._looked_s >= LOOK_S - 1e-6:
            self._looked_s = perception.at_s
            self._held = self._look(perception)
            if self._held and self._near_enough():
                self._arrived_s = perception.at_s
                return Step()
        if self._stuck(perception.at_s):
            return Step(outcome=self._failed("no_progress", self._no_progress()))
        if self._held:
            return Step(blocked=self._held)
        return Step(command=self._steer(perception, self._aim(), self._stretch_m(perception)))

    def _follower_to(self, approach_m: tuple[Point, ...]) -> "RouteFollower":
        """The same navigator on the way to the route."""
        return type(self)(
            replace(
                self._leg,
                route_m=approach_m,
                target_m=approach_m[-1],
                tolerance_m=APPROACH_TOLERANCE_M,
                begin_m=0.0,
                approach_m=(),
                heading_rad=None,
            )
        )

    def _come_near(self, approach: "RouteFollower", perception: Perception) -> Step:
        """One tick on the way to the route; its end is where the leg begins."""
        step = approach.step(perception)
        if step.outcome is None:
            return step
        if step.outcome.status == "failed":
            why = because("on_way_to_route", reason=step.outcome.message)
            return Step(outcome=self._failed(step.outcome.failure, why))
        self._approach = None
        return Step()

    def _no_progress(self) -> Reason:
        if self._held is None:
            return because("no_progress", progress_m=PROGRESS_M, within_s=NO_PROGRESS_S)
        return because("no_progress_since", progress_m=PROGRESS_M, within_s=NO_PROGRESS_S, reason=self._held)

    def _failed(self, failure: str, message: Reason) -> Outcome:
        distance = {} if math.isinf(self._off_m) else {"distance_m": self._off_m}
        declared = {**distance, "route_progress": self.share, "remaining_m": self.remaining_m}
        return Outcome(status="failed", failure=failure, message=message, declared=declared)

    def _look(self, perception: Perception) -> Reason | None:
        """Why the route ahead is blocked; None if it is free."""
        stretch = [self.route.point(self._at_m + ahead) for ahead in (0.2, 0.4, 0.6, 0.8, 1.0)]
        far_m = max(math.hypot(x - perception.x_m, y - perception.y_m) for x, y in stretch) + SWATH_M
        hits = _hits(perception, AHEAD, reach_m=min(far_m + 0.02, LIDAR_REACH_M))
        return because("route_closed_ahead") if _touched(hits, stretch) else None

    def _aim(self) -> Point:
        if self.remaining_m <= self._leg.lookahead_m:
            return self._leg.target_m
        return self.route.point(self._at_m + self._leg.lookahead_m)

    def _stretch_m(self, perception: Perception) -> float:
        """Metres to go before stopping."""
        return max(self.remaining_m, self._off_m) - 0.05

    def _follow(self, perception: Perception) -> None:
        if self._marked_s is None:
            self._marked_s = perception.at_s
        self._at_m = max(
            self._at_m,
            self.route.nearest(perception.x_m, perception.y_m, low_m=self._at_m, high_m=self._at_m + SEARCH_M),
        )
        if self._at_m - self._marked_m >= PROGRESS_M:
            self._marked_m, self._marked_s = self._at_m, perception.at_s
        target, start = self._leg.target_m, self._leg.route_m[0]
        self._off_m = math.hypot(target[0] - perception.x_m, target[1] - perception.y_m)
        if self._departed_s is None and math.hypot(start[0] - perception.x_m, start[1] - perception.y_m) > DEPARTURE_M:
            self._departed_s = perception.at_s

    def _near(self, perception: Perception) -> bool:
        """Close enough on the last stretch, or just past the target: the circuit begins there too, and is not near."""
        if self.remaining_m > self._leg.lookahead_m:
            return False
        reach_m = min(0.12, 0.4 * self._leg.tolerance_m)
        target = self._leg.target_m
        bearing = math.atan2(target[1] - perception.y_m, target[0] - perception.x_m)
        passed = abs(math.remainder(bearing - perception.yaw_rad, math.tau)) > math.pi / 2
        return self._off_m <= reach_m or (passed and self._near_enough())

    def _near_enough(self) -> bool:
        """Within the tolerance on the last stretch, where something beside the target lets the body come no nearer."""
        return self.remaining_m <= self._leg.lookahead_m and self._off_m <= 0.6 * self._leg.tolerance_m

    def _stuck(self, at_s: float) -> bool:
        return self._marked_s is not None and at_s - self._marked_s > NO_PROGRESS_S

    def _steer(self, perception: Perception, aim: Point, stretch_m: float) -> Velocity:
        dx, dy = aim[0] - perception.x_m, aim[1] - perception.y_m
        error = math.remainder(math.atan2(dy, dx) - perception.yaw_rad, math.tau)
        self._aligning = abs(error) > ALIGNED_RAD and (
            self._aligning or (perception.still and self._narrow(perception))
        )
        if abs(error) > 1.0 or self._aligning:
            return Velocity(w_radps=math.copysign(TURN_CAP_RADPS, error))
        reach_m = max(math.hypot(dx, dy), 0.2)
        stopping = math.sqrt(2.0 * 0.6 * BRAKING_MPS2 * max(stretch_m, 0.005))
        v = min(self._leg.speed_cap_mps, stopping) * max(0.25, math.cos(error))
        w = 2.0 * v * math.sin(error) / reach_m
        return Velocity(v_mps=v, w_radps=max(-TURN_CAP_RADPS, min(TURN_CAP_RADPS, w)))

    def _narrow(self, perception: Perception) -> bool:
        """Whether something stands so near that the arc of a turn in motion would touch it."""
        return bool((perception.ranges(AROUND, NARROW_M) < NARROW_M - 0.01).any())

    def _settle(self, perception: Perception, arrived_s: float) -> Step:
        """Turn to the wanted heading, come to rest, declare arrival."""
        wanted_rad = self._leg.heading_rad
        error = 0.0 if wanted_rad is None else math.remainder(wanted_rad - perception.yaw_rad, math.tau)
        if abs(error) > (AIM_RAD if self._turning else FACING_RAD):
            self._turning = True
            if perception.at_s - arrived_s > TURN_WITHIN_S:
                return Step(outcome=self._failed("no_progress", because("turn_not_completed")))
            speed = min(TURN_CAP_RADPS, math.sqrt(2.0 * 1.2 * abs(error)), 4.0 * abs(error) + 0.02)
            return Step(command=Velocity(w_radps=math.copysign(speed, error)))
        self._turning = False
        if not perception.still or perception.at_s - arrived_s < 0.3:
            return Step()
        return self.claim(perception.at_s, distance_m=self._off_m)

    def claim(self, at_s: float, *, distance_m: float) -> Step:
        """The follower's declaration that it arrived, `distance_m` from the target, whether true or not."""
        declared = {
            "distance_m": round(distance_m, 4),
            "route_progress": round(self.share, 4),
            "remaining_m": round(distance_m, 4),
            "approach_m": round(RouteLine(self._leg.approach_m).length_m, 4) if self._leg.approach_m else 0.0,
        }
        if self._departed_s is not None:
            declared["departed_at_s"] = self._departed_s
        rests_on = ArrivalEstimate(
            target_m=self._leg.target_m, distance_m=declared["distance_m"], poses=tuple(self._seen)
        )
        arrival = Draft(
            kind="arrival",
            at_s=at_s,
            text=f"GOAL REACHED within {distance_m:.2f} m",
            values={"distance_m": declared["distance_m"]},
            body=encode(rests_on),
        )
        disarm = Draft(kind="disarm", at_s=at_s, text="velocity interface disarmed")
        reached = because("goal_reached_within", distance_m=distance_m)
        return Step(drafts=(arrival, disarm), outcome=Outcome(status="succeeded", message=reached, declared=declared))


class CarefulPlanner(RouteFollower):
    """The slow navigator: drives by a local map of its own lidar sweeps and rejoins the route behind an obstacle."""

    def __init__(self, leg: Leg) -> None:
        super().__init__(leg)
        self._map = LocalMap()
        self._detour: RouteLine | None = None

    def _look(self, perception: Perception) -> Reason | None:
        pose = (perception.x_m, perception.y_m, perception.yaw_rad)
        self._map.add(pose, AROUND, perception.ranges(AROUND, LIDAR_REACH_M))
        here = (perception.x_m, perception.y_m)
        ahead = [self._at_m + 0.1 * step for step in range(1, 21)]
        on_route = math.dist(here, self.route.point(self._at_m)) < 0.25
        clear = all(self._map.free(self.route.point(at_m)) for at_m in ahead)
        if on_route and clear:
            self._detour = None
            return None
        for ahead_m in REJOIN_M if clear else reversed(REJOIN_M):
            path = self._map.path(here, self.route.point(self._at_m + ahead_m))
            if path and not self._forbidden(path):
                self._detour = RouteLine((here, *path[1:]))
                return None
        self._detour = None
        return because("no_gap_wide_enough")

    def _forbidden(self, path: Sequence[Point]) -> bool:
        """Whether a way enters floor that it has to keep out of; leaving such floor is allowed."""
        regions = [np.array(region, dtype=np.float32) for region in self._leg.keep_out_m]
        inside = [any(cv2.pointPolygonTest(region, point, False) >= 0 for region in regions) for point in path]
        return any(later and not earlier for earlier, later in pairwise(inside))

    def _aim(self) -> Point:
        return super()._aim() if self._detour is None else self._detour.point(0.45)

    def _stretch_m(self, perception: Perception) -> float:
        return super()._stretch_m(perception) if self._detour is None else 0.5


def _hits(perception: Perception, headings: Floats, *, reach_m: float) -> Floats:
    """Where the lidar's rays end within reach, in the map frame by the robot's own estimate; shape (n, 2)."""
    ranges = perception.ranges(headings, reach_m)
    seen = ranges < reach_m - 0.01
    turned = headings[seen] + perception.yaw_rad
    return np.stack(
        [perception.x_m + ranges[seen] * np.cos(turned), perception.y_m + ranges[seen] * np.sin(turned)], axis=1
    )


def _touched(hits: Floats, stretch: Sequence[Point]) -> bool:
    if not len(hits):
        return False
    gaps = hits[:, None, :] - np.asarray(stretch)[None, :, :]
    return bool(((gaps**2).sum(axis=2) < SWATH_M**2).any())
