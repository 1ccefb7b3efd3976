"""Measures the robot's own motion by joint encoders, foot contacts and an IMU: it drifts, slips with the feet, and
detects a fall.

Nothing here knows the true pose. The IMU has a bias of its own for each mission, the legs a scale.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simulator.noise import Streams
from simulator.walking.gait import CONTROL_S, BodySense, Mode
from simulator.walking.legs import FootMotion
from simulator.walking.model import WalkingModel

STANCE_N = 12.0
LEG_SCALE, TURN_BIAS_RADPS, TILT_BIAS_RAD = 0.008, 0.0015, 0.004
TURN_NOISE_RADPS, TILT_NOISE_RAD, JOINT_NOISE_RAD, JOINT_SPEED_NOISE_RADPS = 0.004, 0.001, 0.0003, 0.01
SLIP = 1.035
"""By how much the feet slip on the average, by calibration on walks over a flat floor."""
GRAVITY_MPS2 = 9.81
TIPPED_RAD, LOW_M, FALLEN_S = 0.8, 0.17, 0.2
HELPLESS_RAD = 1.0
"""From a greater tilt the legs cannot push the trunk up: somebody has to set the robot on its feet."""
SMOOTH = 0.15
DRAWS = ("gyro-x", "gyro-y", "gyro-z", "tilt-x", "tilt-y")
Floats = NDArray[np.float64]


class Proprioception:
    """Odometer (m, m, rad in the odometry frame), twist, attitude and height, by the robot's own sensors."""

    def __init__(self, streams: Streams) -> None:
        self.odometer = (0.0, 0.0, 0.0)
        self.roll_rad = self.pitch_rad = 0.0
        self.height_m = 0.3
        self.twist = np.zeros(3)
        self.acceleration = np.zeros(3)
        self.turning = np.zeros(3)
        self.fallen: Literal["", "tipped", "collapsed"] = ""
        self._bad_s = 0.0
        self._down = np.array([0.0, 0.0, -1.0])
        self.reseed(streams)

    def reseed(self, streams: Streams) -> None:
        """Another mission: other biases, and every stream of chance from its first draw."""
        self._streams, self._tick = streams, 0
        self._scale = 1.0 + LEG_SCALE * streams.normal("legs-scale", 0)
        self._turn_bias = TURN_BIAS_RADPS * streams.normal("gyro-bias", 0)
        self._tilt_bias = TILT_BIAS_RAD * np.array([streams.normal("tilt-bias", 0), streams.normal("tilt-bias", 1)])
        self._joints = np.random.Generator(np.random.Philox(key=[streams.seed & 0xFFFFFFFF, 0x4C454753]))

    @property
    def tilt_rad(self) -> float:
        """Between the trunk's own up and the true one, by the IMU."""
        return math.acos(max(-1.0, min(1.0, -float(self._down[2]))))

    def level(self) -> Floats:
        """Turns trunk coordinates upright by the IMU's roll and pitch; ahead stays ahead."""
        return levelling(self.roll_rad, self.pitch_rad)

    def sense(self, world: WalkingModel, mode: Mode, *, rising: bool = False) -> BodySense:
        """Read all sensors once; CONTROL_S has passed since the last time. One that is `rising` may still be low."""
        self._tick += 1
        data = world.data
        draws = self._streams.normals(DRAWS, self._tick)
        turning = np.asarray(data.qvel[3:6]) + TURN_NOISE_RADPS * np.array(draws[:3])
        turning[2] += self._turn_bias
        down = -data.xmat[world.trunk].reshape(3, 3)[2]
        down[:2] += self._tilt_bias + TILT_NOISE_RAD * np.array(draws[3:])
        self._down = down / np.linalg.norm(down)
        x, y, z = self._down.tolist()
        self.roll_rad, self.pitch_rad = math.atan2(-y, -z), math.atan2(x, math.hypot(y, z))
        angles = data.qpos[world.joints] + JOINT_NOISE_RAD * self._joints.standard_normal(12)
        rates = data.qvel[world.speeds] + JOINT_SPEED_NOISE_RADPS * self._joints.standard_normal(12)
        self.turning = turning
        self._move(FootMotion(angles, rates, self._down), turning, data.sensordata[world.touches] > STANCE_N, mode)
        self._watch(upright=mode in ("walking", "standing") and not rising)
        specific = np.asarray(data.sensordata[world.accelerometer : world.accelerometer + 3])
        self.acceleration = self.level() @ specific - np.array([0.0, 0.0, GRAVITY_MPS2])
        return BodySense(turning=turning, down=self._down, angles=angles, rates=rates, velocity=self.twist)

    def _move(self, feet: FootMotion, turning: Floats, standing: NDArray[np.bool_], mode: Mode) -> None:
        level = self.level()
        velocity = feet.trunk_velocity(turning, standing)
        turn = float((level @ turning)[2])
        if velocity is None or mode == "limp":
            ahead, aside = (0.0, 0.0) if mode == "limp" else (float(self.twist[0]), float(self.twist[1]))
        else:
            ahead, aside, _ = (self._scale / SLIP * (level @ velocity)).tolist()
        height_m = feet.height_m(self._down, standing)
        if height_m is not None:
            self.height_m += SMOOTH * (height_m - self.height_m)
        x, y, yaw = self.odometer
        middle = yaw + 0.5 * turn * CONTROL_S
        cos, sin = math.cos(middle), math.sin(middle)
        x += (ahead * cos - aside * sin) * CONTROL_S
        y += (ahead * sin + aside * cos) * CONTROL_S
        self.odometer = (x, y, math.remainder(yaw + turn * CONTROL_S, math.tau))
        self.twist = self.twist + SMOOTH * (np.array([ahead, aside, turn]) - self.twist)

    def _watch(self, *, upright: bool) -> None:
        tipped = self.tilt_rad > TIPPED_RAD
        collapsed = upright and self.height_m < LOW_M
        self._bad_s = self._bad_s + CONTROL_S if tipped or collapsed else 0.0
        if self._bad_s >= FALLEN_S:
            self.fallen = "tipped" if tipped else "collapsed"

    def wake(self, world: WalkingModel) -> None:
        """Switched on where it lies: whether it has fallen is seen before anything else."""
        self.sense(world, "standing", rising=True)
        self.fallen = "tipped" if self.tilt_rad > TIPPED_RAD else ""

    def set_on_feet(self, height_m: float) -> None:
        """Somebody set the robot down on its feet: the odometer did not see it."""
        self.fallen, self._bad_s, self.height_m = "", 0.0, height_m
        self.twist = np.zeros(3)

    def upright(self) -> bool:
        """Whether the robot stands again after it rose; only then it no longer counts as fallen."""
        if self.tilt_rad < 0.3 * TIPPED_RAD and self.height_m > LOW_M:
            self.fallen, self._bad_s = "", 0.0
        return not self.fallen


def levelling(roll_rad: float, pitch_rad: float) -> Floats:
    """The rotation by roll, then pitch: from trunk coordinates to upright ones with the same heading."""
    cos_r, sin_r, cos_p, sin_p = math.cos(roll_rad), math.sin(roll_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    return np.array(
        [[cos_p, sin_p * sin_r, sin_p * cos_r], [0.0, cos_r, -sin_r], [-sin_p, cos_p * sin_r, cos_p * cos_r]]
    )
