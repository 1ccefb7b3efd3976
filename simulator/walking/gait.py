"""Turns a velocity command into joint torques: a trained policy walks, position control stands, lies, and goes limp.

It knows what the robot's own sensors measure, and never its true motion.
"""

from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from simulator.walking.legs import FootMotion
from simulator.walking.stance import UprightStance

CONTROL_S = 0.02
STANDING_POSE = np.array([0.0, 0.8, -1.5] * 4)
LYING_POSE = np.array([0.0, 1.25, -2.6] * 4)
WALKING_GAINS, STANDING_GAINS, LIMP_GAINS = (20.0, 0.5), (60.0, 3.0), (0.0, 1.5)
ACTION_SCALE = np.array([0.125, 0.25, 0.25] * 4)
TURN_SCALE, JOINT_SPEED_SCALE = 0.25, 0.05
SLEW = np.array([0.02, 0.02, 0.06])
"""The most that forward, lateral and turning command change within CONTROL_S."""
LIMITS = np.array([0.8, 0.3, 1.2])
RESERVE = np.array([0.9, 1.0, 1.0])
"""The trunk swings about its mean speed with each step: that much of a commanded speed keeps it below a cap."""
STOPPED_S, SLOW_MPS = 0.1, 0.25
RAISE_S, SETTLE_S = 1.2, 0.3
TRACK_S, TRACK_GAINS, TRACK_LIMITS = 0.3, np.array([0.3, 1.0, 2.0]), np.array([0.1, 0.3, 0.6])
Floats = NDArray[np.float64]
Mode = Literal["standing", "walking", "lying", "limp"]


class BodySense(msgspec.Struct):
    """What the legs' controller measures: turn rates and gravity in the trunk frame, joints, and its own velocity.

    `velocity` is forward, lateral (m/s) and turning (rad/s) by legs and gyroscope.
    """

    turning: Floats
    down: Floats
    angles: Floats
    rates: Floats
    velocity: Floats


class WalkingPolicy:
    """The trained network: 45 observations in, 12 joint targets out."""

    def __init__(self, file: Path) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
        self._input = self._session.get_inputs()[0].name
        self._action: Floats = np.zeros(12)

    def begin(self) -> None:
        """Forget the last action."""
        self._action = np.zeros(12)

    def targets(self, sense: BodySense, command: Floats) -> Floats:
        """Joint angles to strive for, radians."""
        seen = np.concatenate(
            [
                sense.turning * TURN_SCALE,
                sense.down,
                command,
                sense.angles - STANDING_POSE,
                sense.rates * JOINT_SPEED_SCALE,
                self._action,
            ]
        )
        (answer,) = self._session.run(None, {self._input: np.clip(seen, -100, 100).astype(np.float32)[None, :]})
        self._action = np.clip(np.asarray(answer[0], dtype=np.float64), -100, 100)
        targets: Floats = STANDING_POSE + self._action * ACTION_SCALE
        return targets


class VelocityTracking:
    """Adds to the command what the policy leaves behind it, by the velocity that the robot measures of itself."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self.measured, self._trim = np.zeros(3), np.zeros(3)

    def follow(self, measured: Floats) -> None:
        """Smooth the measured velocity."""
        self.measured = self.measured + CONTROL_S / (TRACK_S + CONTROL_S) * (measured - self.measured)

    def trimmed(self, command: Floats) -> Floats:
        self._trim = np.clip(
            self._trim + TRACK_GAINS * (command - self.measured) * CONTROL_S, -TRACK_LIMITS, TRACK_LIMITS
        )
        return command + self._trim


class Gait:
    """Chooses between standing and walking by command and measured speed; lying and limp are ordered."""

    def __init__(self, policy: WalkingPolicy) -> None:
        self.policy, self._tracking, self._stance = policy, VelocityTracking(), UprightStance()
        self._command = np.zeros(3)
        self._stopped_s = 0.0
        self._from, self._since_s, self._within_s = STANDING_POSE, 0.0, SETTLE_S
        self.mode: Mode = "standing"
        self.gains = STANDING_GAINS

    @property
    def risen(self) -> bool:
        """Whether the last change of posture has had its time."""
        return self._since_s >= self._within_s

    def order(self, mode: Mode, angles: Floats) -> None:
        """Stand, lie down or go limp from these joint angles on."""
        if mode != self.mode:
            self._from, self._since_s = angles, 0.0
            self._within_s = SETTLE_S if self.mode == "walking" else RAISE_S
            self.mode = mode
            self._command, self._stopped_s = np.zeros(3), 0.0
            self._stance.begin()

    def targets(self, command: Floats, sense: BodySense) -> Floats:
        """Joint angles for the next CONTROL_S; `gains` say how stiffly they are held."""
        self._tracking.follow(sense.velocity)
        self._since_s += CONTROL_S
        moving = bool(np.any(command))
        if self.mode == "standing" and moving and self.risen:
            self.mode = "walking"
            self.policy.begin()
            self._tracking.begin()
            self._command, self._stopped_s = np.zeros(3), 0.0
        if self.mode == "walking":
            return self._walk(command, sense, moving=moving)
        if self.mode == "limp":
            self.gains = LIMP_GAINS
            return sense.angles
        self.gains = STANDING_GAINS
        pose = LYING_POSE if self.mode == "lying" else STANDING_POSE
        share = min(1.0, self._since_s / self._within_s)
        between: Floats = self._from + share * (pose - self._from)
        if self.mode == "standing" and self.risen:
            feet_m = FootMotion(sense.angles, sense.rates, sense.down).points_m
            between = between + self._stance.angles(pose, sense.down, feet_m, within_s=CONTROL_S)
        return between

    def _walk(self, command: Floats, sense: BodySense, *, moving: bool) -> Floats:
        self.gains = WALKING_GAINS
        most = SLEW if moving else 2.0 * SLEW
        self._command = self._command + np.clip(
            np.clip(command * RESERVE, -LIMITS, LIMITS) - self._command, -most, most
        )
        if moving:
            self._stopped_s = 0.0
            return self.policy.targets(sense, self._tracking.trimmed(self._command))
        self._tracking.begin()
        slow = not self._command.any() and float(np.hypot(*sense.velocity[:2])) < SLOW_MPS
        self._stopped_s += CONTROL_S if slow else 0.0
        if self._stopped_s >= STOPPED_S:
            self.order("standing", sense.angles)
        return self.policy.targets(sense, self._command)
