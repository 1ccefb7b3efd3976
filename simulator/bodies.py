"""Simulates the robot's body in the world: its true pose, how a velocity command moves it, and what its lidar hits.

Three fidelities with one interface. `MujocoBody` integrates the contacts of a sliding hull; `KinematicBody` moves a
disc among footprints; `simulator.walking` has the body with legs.
"""

import math
from typing import Protocol

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from simulator.floor_plan import FloorPlan
from simulator.mjcf import TIMESTEP_S, compile_site
from simulator.solids import ROBOT_RADIUS_M, SiteModel, Tilt

TICK_S = 0.05
LIDAR_HEIGHT_M = 0.45
LIDAR_REACH_M = 12.0
PLAN_HEIGHT_M = 0.28
ACCELERATION_MPS2 = 0.7
BRAKING_MPS2 = 1.2
TURN_RADPS2 = 2.5
SWAY_MPS = 0.015
SWAY_RADPS = 7.5
Floats = NDArray[np.float64]


class Velocity(msgspec.Struct, frozen=True):
    """A command to the body: forward speed and turn rate, m/s and rad/s."""

    v_mps: float = 0.0
    w_radps: float = 0.0


class BodyState(msgspec.Struct):
    """Ground truth: planar pose in the map and the velocities, m, rad, m/s, rad/s. `sway_mps` is lateral.

    A walking body also has its true roll, pitch and lift above its standing height, and may have fallen; `lying` is
    ordered from outside.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    v_mps: float = 0.0
    w_radps: float = 0.0
    sway_mps: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    lift_m: float = 0.0
    fallen: bool = False
    lying: bool = False

    @property
    def tilt(self) -> Tilt:
        """How the trunk stands, for the camera on it."""
        return Tilt(roll_rad=self.roll_rad, pitch_rad=self.pitch_rad, lift_m=self.lift_m)

    @property
    def still(self) -> bool:
        return abs(self.v_mps) < 0.005 and abs(self.w_radps) < 0.01 and abs(self.sway_mps) < 0.005


class SimulatedBody(Protocol):
    """One fidelity."""

    state: BodyState

    def furnish(self, site: SiteModel) -> None:
        """Put the body into another site at its present pose."""

    def step(self, command: Velocity) -> None:
        """One tick of TICK_S under a command; limits of acceleration apply."""

    def ranges(self, headings: Floats, reach_m: float) -> Floats:
        """Flat lidar ranges at PLAN_HEIGHT_M along headings in the body frame, metres, at most `reach_m`."""

    def cloud(self) -> Floats:
        """One full sweep: hits in the body frame, shape (n, 3), metres, z = 0 on the floor."""

    @property
    def stance(self) -> tuple[float, ...]:
        """What a restart needs beside the planar pose; empty for a body without legs."""

    @property
    def can_fall(self) -> bool:
        """Whether it has legs to fall from."""

    def push_over(self) -> None:
        """Somebody pushes it hard from its side."""

    def stand_up(self) -> bool:
        """Begin to rise after a fall; whether the body can try."""

    def set_on_feet(self) -> None:
        """Somebody lifts a fallen body and sets it down where it is."""


class UprightBody:
    """What bodies without legs share: they cannot fall."""

    stance: tuple[float, ...] = ()
    can_fall = False

    def push_over(self) -> None:
        """It stays where it is."""

    def stand_up(self) -> bool:
        return True

    def set_on_feet(self) -> None:
        """It stands."""


class Drive:
    """How the legs follow a command: limited acceleration, and a sway that comes with the gait."""

    def __init__(self) -> None:
        self.v_mps = 0.0
        self.w_radps = 0.0
        self._phase = 0.0

    def follow(self, command: Velocity) -> tuple[float, float, float]:
        """Forward, lateral and turning velocity for the next tick."""
        rate = ACCELERATION_MPS2 if abs(command.v_mps) > abs(self.v_mps) else BRAKING_MPS2
        self.v_mps = _towards(self.v_mps, command.v_mps, rate * TICK_S)
        self.w_radps = _towards(self.w_radps, command.w_radps, TURN_RADPS2 * TICK_S)
        self._phase += SWAY_RADPS * TICK_S
        return self.v_mps, SWAY_MPS * (self.v_mps / 0.5) * math.cos(self._phase), self.w_radps


def _towards(value: float, goal: float, step: float) -> float:
    return goal if abs(goal - value) <= step else value + math.copysign(step, goal - value)


class KinematicBody(UprightBody):
    """A disc that moves as commanded unless a footprint is in the way."""

    def __init__(self, site: SiteModel, state: BodyState) -> None:
        self.state = state
        self._drive = Drive()
        self.furnish(site)

    def furnish(self, site: SiteModel) -> None:
        self._plan = FloorPlan(site)
        self._free_m = 0.0

    def step(self, command: Velocity) -> None:
        state, drive = self.state, self._drive
        if command.v_mps == 0.0 == command.w_radps == drive.v_mps == drive.w_radps:
            state.v_mps = state.w_radps = state.sway_mps = 0.0
            return
        v, sway, w = drive.follow(command)
        yaw = state.yaw_rad + 0.5 * w * TICK_S
        cos, sin = math.cos(yaw), math.sin(yaw)
        x = state.x_m + (v * cos - sway * sin) * TICK_S
        y = state.y_m + (v * sin + sway * cos) * TICK_S
        if self._enters(x, y):
            drive.v_mps = v = sway = 0.0
        else:
            state.x_m, state.y_m = x, y
        state.yaw_rad = math.remainder(state.yaw_rad + w * TICK_S, math.tau)
        state.v_mps, state.w_radps, state.sway_mps = v, w, sway

    def ranges(self, headings: Floats, reach_m: float) -> Floats:
        state = self.state
        return self._plan.rays(state.x_m, state.y_m, headings + state.yaw_rad, reach_m=reach_m)

    def cloud(self) -> Floats:
        ranges = self.ranges(_FLAT, LIDAR_REACH_M)
        hits = ranges < LIDAR_REACH_M
        flat, reach = _FLAT[hits], ranges[hits]
        return np.stack([reach * np.cos(flat), reach * np.sin(flat), np.full(reach.shape, LIDAR_HEIGHT_M)], axis=1)

    def _enters(self, x: float, y: float) -> bool:
        """Exact, but measured again only after the body moved as far as the last measurement left free."""
        self._free_m -= math.hypot(x - self.state.x_m, y - self.state.y_m)
        if self._free_m > 0:
            return False
        here = self._plan.clearance(self.state.x_m, self.state.y_m)
        there = self._plan.clearance(x, y)
        self._free_m = there - ROBOT_RADIUS_M
        return there < ROBOT_RADIUS_M and there < here


class MujocoBody(UprightBody):
    """A velocity-controlled hull in MuJoCo: walls and boxes push back."""

    def __init__(self, site: SiteModel, state: BodyState) -> None:
        self.state = state
        self._drive = Drive()
        self.furnish(site)

    def furnish(self, site: SiteModel) -> None:
        self._site = compile_site(site)
        self._site.data.qpos[:] = (self.state.x_m, self.state.y_m, self.state.yaw_rad)
        mujoco.mj_forward(self._site.model, self._site.data)

    def step(self, command: Velocity) -> None:
        data = self._site.data
        v, sway, w = self._drive.follow(command)
        yaw = float(data.qpos[2]) + 0.5 * w * TICK_S
        cos, sin = math.cos(yaw), math.sin(yaw)
        data.ctrl[:] = (v * cos - sway * sin, v * sin + sway * cos, w)
        mujoco.mj_step(self._site.model, data, nstep=round(TICK_S / TIMESTEP_S))
        x, y, yaw = data.qpos.tolist()
        vx, vy, w = data.qvel.tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        state = self.state
        state.x_m, state.y_m, state.yaw_rad = x, y, math.remainder(yaw, math.tau)
        state.v_mps, state.sway_mps, state.w_radps = vx * cos + vy * sin, vy * cos - vx * sin, w

    def ranges(self, headings: Floats, reach_m: float) -> Floats:
        flat = np.stack([np.cos(headings), np.sin(headings), np.zeros_like(headings)], axis=1)
        distances = self._cast(flat, height_m=PLAN_HEIGHT_M)
        return np.where(distances < 0, reach_m, np.minimum(distances, reach_m))

    def cloud(self) -> Floats:
        distances = self._cast(SWEEP, height_m=LIDAR_HEIGHT_M)
        hits = (distances > 0) & (distances < LIDAR_REACH_M)
        points: Floats = SWEEP[hits] * distances[hits, None]
        points[:, 2] += LIDAR_HEIGHT_M
        return points

    def _cast(self, rays: Floats, *, height_m: float) -> Floats:
        state, site = self.state, self._site
        cos, sin = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
        turned = rays @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        count = len(turned)
        hit, distance = np.empty(count, dtype=np.int32), np.empty(count)
        origin = np.array([state.x_m, state.y_m, height_m])
        mujoco.mj_multiRay(
            site.model, site.data, origin, turned.reshape(-1), None, 1, site.chassis, hit, distance, None, count, 1e9
        )
        return distance


def _sweep() -> Floats:
    around, rings = np.linspace(-np.pi, np.pi, 360, endpoint=False), np.radians(np.linspace(-22, 16, 16))
    azimuth, elevation = np.meshgrid(around, rings)
    across = np.cos(elevation)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)], axis=2).reshape(-1, 3)


SWEEP = _sweep()
_FLAT = np.linspace(-np.pi, np.pi, 360, endpoint=False)
