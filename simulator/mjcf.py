"""Converts a site model to MuJoCo: one XML of cuboids, a floor, and a quadruped that slides and turns on the plane."""

from typing import Any
from xml.sax.saxutils import quoteattr

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from simulator.solids import ROBOT_RADIUS_M, SiteModel, Solid

TIMESTEP_S = 0.01
_LEGS = tuple(
    f'<geom name="leg-{i}" type="capsule" fromto="{x} {y} 0.0 {x - 0.05} {y} -0.28" size="0.035" '
    'contype="0" conaffinity="0" rgba="0.15 0.15 0.17 1"/>'
    for i, (x, y) in enumerate(((0.22, 0.14), (0.22, -0.14), (-0.22, 0.14), (-0.22, -0.14)))
)


class CompiledSite(msgspec.Struct, frozen=True):
    """A compiled model with its own working memory. `rgb` is float32 (geoms + 1, 3); the last row is the background.

    `signs` are the solids with text on them, by number of their geom.
    """

    model: Any
    data: Any
    chassis: int
    floor: int
    rgb: NDArray[np.float32]
    signs: tuple[tuple[int, Solid], ...] = ()


def compile_site(site: SiteModel) -> CompiledSite:
    """Build and compile; MuJoCo raises ValueError if a solid is degenerate."""
    model = mujoco.MjModel.from_xml_string(mjcf(site))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    background = np.array([[0.93, 0.94, 0.95, 1.0]], dtype=np.float32)
    rgb = np.concatenate([np.asarray(model.geom_rgba, dtype=np.float32), background])[:, :3]
    chassis = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "chassis")
    floor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "floor")
    signs = tuple(
        (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, solid.name), solid) for solid in site.solids if solid.text
    )
    return CompiledSite(
        model=model, data=data, chassis=chassis, floor=floor, rgb=np.ascontiguousarray(rgb), signs=signs
    )


def mjcf(site: SiteModel) -> str:
    """The MJCF document of a site. Body joints: slide_x, slide_y, turn; velocity actuators of the same names."""
    geoms = "\n".join(_geom(solid) for solid in site.solids)
    floor = " ".join(f"{part:.3f}" for part in site.floor_rgb)
    return f"""<mujoco model={quoteattr(site.name)}>
<option timestep="{TIMESTEP_S}" gravity="0 0 0" integrator="implicitfast"/>
<worldbody>
<geom name="floor" type="plane" size="60 60 1" contype="0" conaffinity="0" rgba="{floor} 1"/>
{geoms}
<body name="chassis" pos="0 0 0.32">
<joint name="slide_x" type="slide" axis="1 0 0"/>
<joint name="slide_y" type="slide" axis="0 1 0"/>
<joint name="turn" type="hinge" axis="0 0 1"/>
<geom name="hull" type="cylinder" size="{ROBOT_RADIUS_M} 0.15" mass="15" friction="0.4" rgba="0.8 0.8 0.82 1"/>
<geom name="trunk" type="box" size="0.31 0.12 0.07" contype="0" conaffinity="0" mass="1" rgba="0.8 0.8 0.82 1"/>
{"".join(_LEGS)}
</body>
</worldbody>
<actuator>
<velocity name="slide_x" joint="slide_x" kv="400" forcerange="-90 90" forcelimited="true"/>
<velocity name="slide_y" joint="slide_y" kv="400" forcerange="-90 90" forcelimited="true"/>
<velocity name="turn" joint="turn" kv="20" forcerange="-12 12" forcelimited="true"/>
</actuator>
</mujoco>"""


def _geom(solid: Solid) -> str:
    collide = 1 if solid.blocks else 0
    return (
        f'<geom name={quoteattr(solid.name)} type="box" '
        f'pos="{_numbers(solid.centre_m)}" size="{_numbers(solid.half_m)}" '
        f'euler="0 0 {np.degrees(solid.yaw_rad):.5f}" contype="{collide}" conaffinity="{collide}" '
        f'rgba="{_numbers(solid.rgb)} 1"/>'
    )


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.5f}" for value in values)
