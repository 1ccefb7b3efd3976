"""Skills that take pictures: a panorama by segmented rotation in place, and observing while standing still."""

import math

from harness.contracts.ids import RequestId
from harness.contracts.reasons import because
from simulator.bodies import Velocity
from simulator.skill_interface import Draft, Outcome, Perception, Step

TURN_CAP_RADPS = 0.9
AIM_RAD = 0.012
STATIC_S = 1.15


class Panorama:
    """`frames` equal turns, each followed by standing still and one picture; the last turn ends at the first heading.

    `segment_s` is the least duration of one turn with its picture, seconds.
    """

    def __init__(self, frames: int, segment_s: float, request: RequestId) -> None:
        self._frames, self._segment_s, self._request = frames, segment_s, request
        self._first_rad: float | None = None
        self._done = 0
        self._begun_s = 0.0
        self._turned_s: float | None = None
        self._still_s: float | None = None

    @property
    def share(self) -> float:
        return self._done / self._frames

    @property
    def remaining_m(self) -> float | None:
        return None

    def resume(self, at_s: float) -> None:
        self._still_s = None

    def step(self, perception: Perception) -> Step:
        """Turn, settle, capture, until the circle is closed."""
        if self._first_rad is None:
            self._first_rad, self._begun_s = perception.yaw_rad, perception.at_s
        goal = self._first_rad + math.tau * (self._done + 1) / self._frames
        error = math.remainder(goal - perception.yaw_rad, math.tau)
        if self._turned_s is None:
            if abs(error) > AIM_RAD:
                speed = min(TURN_CAP_RADPS, math.sqrt(2.0 * 1.2 * abs(error)), 4.0 * abs(error) + 0.02)
                return Step(command=Velocity(w_radps=math.copysign(speed, error)))
            self._turned_s = perception.at_s
        if not perception.still:
            self._still_s = None
            return Step()
        if self._still_s is None:
            self._still_s = perception.at_s
        if perception.at_s - self._still_s < STATIC_S or perception.at_s - self._begun_s < self._segment_s:
            return Step()
        return self._capture(perception, math.remainder(goal, math.tau), self._turned_s)

    def _capture(self, perception: Perception, heading: float, turned_s: float) -> Step:
        shot = perception.capture(heading, self._request)
        index = float(self._done)
        rotation = Draft(
            kind="rotation",
            at_s=turned_s,
            text=f"rotation-{self._request[:16]}-{self._done}",
            values={"yaw_rad": heading, "index": index, "measured_rad": perception.yaw_rad},
        )
        capture = Draft(
            kind="capture",
            at_s=shot.at_s,
            text=f"capture-{self._request[:16]}-{self._done}",
            blob=shot.blob,
            values={"index": index, "yaw_rad": heading},
        )
        self._done += 1
        self._begun_s, self._turned_s, self._still_s = perception.at_s, None, None
        outcome = None
        if self._done == self._frames:
            outcome = Outcome(
                status="succeeded",
                message=because("turn_photographed", frames=self._frames),
                declared={"frames": float(self._frames), "turned_rad": math.tau},
            )
        return Step(drafts=(rotation, capture), shots=(shot,), outcome=outcome)


class Observer:
    """Stands and looks for `duration_s`; takes one picture first if asked."""

    def __init__(self, duration_s: float, frames: int, request: RequestId) -> None:
        self._duration_s, self._frames, self._request = duration_s, frames, request
        self._begun_s: float | None = None
        self._share = 0.0

    @property
    def share(self) -> float:
        return self._share

    @property
    def remaining_m(self) -> float | None:
        return None

    def resume(self, at_s: float) -> None:
        self._begun_s = at_s

    def step(self, perception: Perception) -> Step:
        """Nothing moves; time passes."""
        shots, drafts = [], []
        if self._begun_s is None:
            self._begun_s = perception.at_s
            if self._frames:
                shot = perception.capture(perception.yaw_rad, self._request)
                shots.append(shot)
                drafts.append(Draft(kind="capture", at_s=shot.at_s, text="observation", blob=shot.blob))
        looked_s = perception.at_s - self._begun_s
        self._share = min(1.0, looked_s / self._duration_s)
        outcome = None
        if looked_s >= self._duration_s:
            message = because("observed_for", looked_s=looked_s)
            outcome = Outcome(status="succeeded", message=message, declared={"looked_s": looked_s})
        return Step(drafts=tuple(drafts), shots=tuple(shots), outcome=outcome)
