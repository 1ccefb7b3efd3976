"""Compiles a site with a Unitree Go2 in it: gravity, walls and boxes that stop legs, feet that touch and slip.

The inertias, frictions and joint losses are the package's fit to runs of a real Go2 under the same policy.
"""

import math
from typing import Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from simulator.solids import SiteModel
from simulator.walking.go2_package import model_file
from simulator.walking.legs import LEGS

TIMESTEP_S = 0.0025
JOINTS = tuple(f"{leg}_{part}_joint" for leg in LEGS for part in ("hip", "thigh", "calf"))
TRUNK, PREFIX = "base", "go2/"
ROBOT_GROUP = 3
"""Collision shapes of the robot are of this group, so that its own lidar looks through them."""
ARMATURE, DAMPING, FRICTION_LOSS = 0.00712, 0.2850, 0.3650
TRUNK_MASS, TRUNK_INERTIA, TRUNK_AHEAD_M, LEG_MASS = 0.9412, 0.8601, -0.006845, 1.616
FOOT_FRICTION, FOOT_TORSION = 0.7860, 0.006134
FOOT_SENSOR_M = 0.03
Ints = NDArray[np.int32]
Floats = NDArray[np.float64]


class WalkingModel(msgspec.Struct, frozen=True):
    """A compiled site with the robot, and where in MuJoCo's arrays its parts are; joints in the order of JOINTS."""

    model: Any
    data: Any
    trunk: int
    joints: Ints
    speeds: Ints
    actuators: Ints
    torque_limits: Floats
    feet: tuple[int, ...]
    touches: Ints
    accelerometer: int


def walking_model(site: SiteModel) -> WalkingModel:
    """Compile; the meshes that only draw the robot are left out, so that nothing large is read."""
    world = _world(site)
    world.attach(_robot(), prefix=PREFIX, frame=world.worldbody.add_frame())
    _add_sensors(world)
    model = world.compile()
    joints = [model.joint(PREFIX + name).id for name in JOINTS]
    actuator_of = {int(model.actuator_trnid[one, 0]): one for one in range(model.nu)}
    actuators = np.array([actuator_of[one] for one in joints], dtype=np.int32)
    return WalkingModel(
        model=model,
        data=mujoco.MjData(model),
        trunk=model.body(PREFIX + TRUNK).id,
        joints=np.asarray(model.jnt_qposadr[joints], dtype=np.int32),
        speeds=np.asarray(model.jnt_dofadr[joints], dtype=np.int32),
        actuators=actuators,
        torque_limits=np.asarray(model.actuator_ctrlrange[actuators, 1]),
        feet=tuple(model.geom(PREFIX + leg).id for leg in LEGS),
        touches=np.array([model.sensor(f"touch-{leg}").adr[0] for leg in LEGS], dtype=np.int32),
        accelerometer=int(model.sensor("accelerometer").adr[0]),
    )


def _world(site: SiteModel) -> Any:
    world = mujoco.MjSpec()
    world.option.timestep = TIMESTEP_S
    world.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    world.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    world.option.impratio = 100.0
    world.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[60, 60, 1])
    for solid in site.solids:
        collide = 1 if solid.blocks else 0
        world.worldbody.add_geom(
            name=solid.name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=list(solid.centre_m),
            size=list(solid.half_m),
            quat=[math.cos(solid.yaw_rad / 2), 0.0, 0.0, math.sin(solid.yaw_rad / 2)],
            contype=collide,
            conaffinity=collide,
        )
    return world


def _robot() -> Any:
    robot = mujoco.MjSpec.from_file(str(model_file()))
    for key in list(robot.keys):
        robot.delete(key)
    for geom in [one for one in robot.geoms if one.type == mujoco.mjtGeom.mjGEOM_MESH]:
        robot.delete(geom)
    for mesh in list(robot.meshes):
        robot.delete(mesh)
    _fit(robot)
    for leg in LEGS:
        foot = robot.geom(leg)
        robot.body(f"{leg}_calf").add_site(
            name=f"foot-{leg}", pos=foot.pos, size=[FOOT_SENSOR_M, 0, 0], type=mujoco.mjtGeom.mjGEOM_SPHERE
        )
    return robot


def _fit(robot: Any) -> None:
    for name in JOINTS:
        joint = robot.joint(name)
        joint.armature, joint.frictionloss, joint.damping = ARMATURE, FRICTION_LOSS, [DAMPING, 0.0, 0.0]
    trunk = robot.body(TRUNK)
    trunk.mass *= TRUNK_MASS
    trunk.inertia = np.asarray(trunk.inertia) * TRUNK_INERTIA
    trunk.ipos = np.asarray(trunk.ipos) + np.array([TRUNK_AHEAD_M, 0.0, 0.0])
    for leg in LEGS:
        for part in (robot.body(f"{leg}_thigh"), robot.body(f"{leg}_calf")):
            part.mass *= LEG_MASS
            part.inertia = np.asarray(part.inertia) * LEG_MASS
        foot = robot.geom(leg)
        foot.friction = [FOOT_FRICTION, FOOT_TORSION, foot.friction[2]]


def _add_sensors(world: Any) -> None:
    for leg in LEGS:
        world.add_sensor(
            name=f"touch-{leg}",
            type=mujoco.mjtSensor.mjSENS_TOUCH,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=f"{PREFIX}foot-{leg}",
        )
    world.add_sensor(
        name="accelerometer",
        type=mujoco.mjtSensor.mjSENS_ACCELEROMETER,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=PREFIX + "imu",
    )
