"""Walks a Unitree Go2 through the site: contact physics moves it, a trained policy steps, and it can fall.

`state` is the truth; `own` is what the robot measures of itself. The command reaches the legs only.
"""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from simulator.bodies import LIDAR_HEIGHT_M, LIDAR_REACH_M, PLAN_HEIGHT_M, SWEEP, TICK_S, BodyState, Velocity
from simulator.noise import Streams
from simulator.solids import TRUNK_HEIGHT_M, SiteModel
from simulator.walking.gait import CONTROL_S, STANDING_POSE, Gait, WalkingPolicy
from simulator.walking.go2_package import policy_file
from simulator.walking.model import ROBOT_GROUP, TIMESTEP_S, walking_model
from simulator.walking.proprioception import HELPLESS_RAD, Proprioception

MOTOR_LAG_S = 0.0151
SUBSTEPS, CONTROL_STEPS = round(TICK_S / TIMESTEP_S), round(CONTROL_S / TIMESTEP_S)
PUSH_MPS, PUSH_RADPS = np.array([0.0, -3.0, 2.0]), np.array([6.0, 0.0, 0.0])
BEAMS, RINGS = 90, (3, 6, 9, 11, 13)
Floats = NDArray[np.float64]
_LAG = TIMESTEP_S / (MOTOR_LAG_S + TIMESTEP_S)
_GROUPS = np.array([group != ROBOT_GROUP for group in range(mujoco.mjNGROUP)], dtype=np.uint8)
_LIDAR, _PLAN = (np.array([0.0, 0.0, height - TRUNK_HEIGHT_M]) for height in (LIDAR_HEIGHT_M, PLAN_HEIGHT_M))
_FEW: Floats = np.concatenate([SWEEP.reshape(16, 360, 3)[ring, :: 360 // BEAMS] for ring in RINGS])


class WalkingBody:
    """Implements `bodies.SimulatedBody`. `stance` is what `stance` gave before a restart: it lies as it lay."""

    can_fall = True

    def __init__(self, site: SiteModel, state: BodyState, *, stance: tuple[float, ...] = ()) -> None:
        self.state = state
        self.own = Proprioception(Streams(0))
        self._gait = Gait(WalkingPolicy(policy_file()))
        self._targets, self._torques = STANDING_POSE, np.zeros(12)
        self._substep = 0
        self._rising = False
        self._world = walking_model(site)
        self._placed: tuple[float, float, float] | None = None
        if stance:
            self._take(np.array(stance))
            self.own.wake(self._world)
            self._tell()
        else:
            self._set_down()

    def furnish(self, site: SiteModel) -> None:
        """Other things stand around it; where its pose was changed from outside it is set on its feet there."""
        stance, speeds = self._world.data.qpos.copy(), self._world.data.qvel.copy()
        self._world = walking_model(site)
        if self._placed == (self.state.x_m, self.state.y_m, self.state.yaw_rad):
            self._world.data.qvel[:] = speeds
            self._take(stance)
        else:
            self._set_down()

    def step(self, command: Velocity) -> None:
        """TICK_S: the policy runs every CONTROL_S, the motors every physics step."""
        world, data = self._world, self._world.data
        for _ in range(SUBSTEPS):
            if self._substep % CONTROL_STEPS == 0:
                self._control(np.array([command.v_mps, 0.0, command.w_radps]))
            stiffness, damping = self._gait.gains
            torque = stiffness * (self._targets - data.qpos[world.joints]) - damping * data.qvel[world.speeds]
            torque = np.clip(torque, -world.torque_limits, world.torque_limits)
            self._torques += _LAG * (torque - self._torques)
            data.ctrl[world.actuators] = self._torques
            mujoco.mj_step(world.model, data)
            self._substep += 1
        self._tell()

    def ranges(self, headings: Floats, reach_m: float) -> Floats:
        """As `SimulatedBody.ranges`; flat by the IMU, from a scanner that bobs and tilts with the trunk."""
        flat = np.stack([np.cos(headings), np.sin(headings), np.zeros_like(headings)], axis=1)
        distances = self._cast(flat @ self.own.level(), _PLAN)
        return np.where(distances < 0, reach_m, np.minimum(distances, reach_m))

    def cloud(self) -> Floats:
        """As `SimulatedBody.cloud`; made upright by the IMU and lifted by the legs, with their errors."""
        return self._hits(SWEEP)

    def sweep(self) -> Floats:
        """Some beams of the same lidar, for the localiser, shape (n, 3)."""
        return self._hits(_FEW)

    @property
    def steps(self) -> bool:
        """Whether the legs are stepping, as their controller knows."""
        return self._gait.mode == "walking"

    def push_over(self) -> None:
        """Somebody pushes it hard from its left side, and it rolls over."""
        turn = self._world.data.xmat[self._world.trunk].reshape(3, 3)
        self._world.data.qvel[:3] += turn @ PUSH_MPS
        self._world.data.qvel[3:6] += PUSH_RADPS

    def stand_up(self) -> bool:
        """Try to rise from where it fell; whether the legs can reach the floor for that."""
        if self.own.tilt_rad > HELPLESS_RAD:
            return False
        self._rising = True
        self._gait.order("standing", self._world.data.qpos[self._world.joints].copy())
        return True

    def set_on_feet(self) -> None:
        """Somebody lifts it and sets it down where it is."""
        self._set_down()

    @property
    def stance(self) -> tuple[float, ...]:
        """Position, attitude and joint angles, for a restart."""
        return tuple(self._world.data.qpos.tolist())

    def _control(self, command: Floats) -> None:
        state, own, gait = self.state, self.own, self._gait
        sense = own.sense(self._world, gait.mode, rising=not gait.risen)
        if self._rising:
            if gait.risen:
                self._rising = False
                own.upright()
        elif own.fallen:
            gait.order("limp", sense.angles)
        elif state.lying:
            gait.order("lying", sense.angles)
        elif gait.mode in ("lying", "limp"):
            gait.order("standing", sense.angles)
        self._targets = gait.targets(command, sense)

    def _hits(self, rays: Floats) -> Floats:
        distances = self._cast(rays, _LIDAR)
        hits = (distances > 0) & (distances < LIDAR_REACH_M)
        points: Floats = (rays[hits] * distances[hits, None] + _LIDAR) @ self.own.level().T
        points[:, 2] += self.own.height_m
        return points

    def _cast(self, rays: Floats, mount: Floats) -> Floats:
        """Distances along rays of the trunk frame from a place on the trunk, -1 where nothing is."""
        world = self._world
        turn = world.data.xmat[world.trunk].reshape(3, 3)
        origin = world.data.xpos[world.trunk] + turn @ mount
        turned = np.ascontiguousarray(rays @ turn.T)
        count = len(rays)
        hit, distance = np.empty(count, dtype=np.int32), np.empty(count)
        mujoco.mj_multiRay(
            world.model, world.data, origin, turned.reshape(-1), _GROUPS, 1, -1, hit, distance, None, count, 1e9
        )
        return distance

    def _set_down(self) -> None:
        """Standing at the pose of `state`, at rest, feet on the floor."""
        world, data, state = self._world, self._world.data, self.state
        mujoco.mj_resetData(world.model, data)
        half = 0.5 * state.yaw_rad
        data.qpos[:7] = (state.x_m, state.y_m, 0.5, math.cos(half), 0.0, 0.0, math.sin(half))
        data.qpos[world.joints] = STANDING_POSE
        mujoco.mj_forward(world.model, data)
        data.qpos[2] -= min(float(data.geom_xpos[foot][2] - world.model.geom_size[foot][0]) for foot in world.feet)
        self._gait = Gait(self._gait.policy)
        self._targets, self._torques, self._rising = STANDING_POSE, np.zeros(12), False
        self.own.set_on_feet(TRUNK_HEIGHT_M)
        self._take(data.qpos.copy())

    def _take(self, stance: Floats) -> None:
        self._world.data.qpos[:] = stance
        mujoco.mj_forward(self._world.model, self._world.data)
        self._tell()

    def _tell(self) -> None:
        """Writes the truth into `state`."""
        world, state = self._world, self.state
        turn = world.data.xmat[world.trunk].reshape(3, 3)
        x, y, z = world.data.xpos[world.trunk].tolist()
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        vx, vy = world.data.qvel[:2].tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        state.x_m, state.y_m, state.yaw_rad = x, y, yaw
        state.v_mps, state.sway_mps = vx * cos + vy * sin, vy * cos - vx * sin
        state.w_radps = float((turn @ world.data.qvel[3:6])[2])
        state.roll_rad, state.pitch_rad = (
            math.atan2(turn[2, 1], turn[2, 2]),
            -math.asin(max(-1.0, min(1.0, turn[2, 0]))),
        )
        state.lift_m = z - TRUNK_HEIGHT_M
        state.fallen = bool(self.own.fallen)
        self._placed = (x, y, yaw)
