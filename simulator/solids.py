"""The simulated site as typed solids: walls, boxes and other things, from which physics and pictures are built."""

import math
from typing import Literal

from harness.contracts.values import Name, Point, Positive, Value

Rgb = tuple[float, float, float]
Kind = Literal["wall", "box", "shelf", "desk", "chair", "poster", "mark", "door", "sign"]
FLAT: frozenset[str] = frozenset({"poster", "mark", "sign"})
ROBOT_RADIUS_M = 0.25
ROBOT_HEIGHT_M = 0.6
TRUNK_HEIGHT_M = 0.303
"""Of a walking body's trunk when it stands: lidar and camera turn with it about this height."""


class Tilt(Value):
    """How a body's trunk stands: rolled to its right side, pitched nose down, lifted above its standing height."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    lift_m: float = 0.0


LEVEL = Tilt()


class Solid(Value):
    """One cuboid in the map frame: centre and half sizes in metres, turned by `yaw_rad`, colours from 0 to 1.

    `text` stands on the face that looks along `yaw_rad`, dark on the cuboid's own colour.
    """

    name: Name
    kind: Kind
    centre_m: tuple[float, float, float]
    half_m: tuple[Positive, Positive, Positive]
    rgb: Rgb
    yaw_rad: float = 0.0
    text: str = ""

    @property
    def blocks(self) -> bool:
        """Whether the robot's body collides with it: paint and posters do not, nor does what hangs overhead."""
        return self.kind not in FLAT and self.centre_m[2] - self.half_m[2] < ROBOT_HEIGHT_M

    def corners(self) -> tuple[Point, Point, Point, Point]:
        """The footprint's corners, counter-clockwise, metres."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y = self.centre_m[0], self.centre_m[1]
        hx, hy = self.half_m[0], self.half_m[1]
        offsets = ((hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy))
        first, second, third, fourth = ((x + cos * dx - sin * dy, y + sin * dx + cos * dy) for dx, dy in offsets)
        return first, second, third, fourth


class SiteModel(Value):
    """Everything that stands, hangs or is painted at a site. The floor is the plane z = 0."""

    name: Name
    frame: Name
    map_version: Name
    solids: tuple[Solid, ...]
    floor_rgb: Rgb = (0.62, 0.63, 0.65)
    lamps_m: tuple[tuple[float, float, float], ...] = ((10.0, 7.0, 6.0),)
    brightness: Positive = 1.0

    def with_solids(self, *extra: Solid) -> "SiteModel":
        """The same site with more things in it."""
        return SiteModel(
            name=self.name,
            frame=self.frame,
            map_version=self.map_version,
            solids=self.solids + extra,
            floor_rgb=self.floor_rgb,
            lamps_m=self.lamps_m,
            brightness=self.brightness,
        )


def wall(name: str, start: Point, end: Point) -> Solid:
    """A wall 0.1 m thick and 2.4 m high along an axis-parallel line."""
    (x0, y0), (x1, y1) = start, end
    return Solid(
        name=name,
        kind="wall",
        centre_m=((x0 + x1) / 2, (y0 + y1) / 2, 1.2),
        half_m=(max(abs(x1 - x0) / 2, 0.05), max(abs(y1 - y0) / 2, 0.05), 1.2),
        rgb=(0.87, 0.87, 0.84),
    )


def standing(name: str, kind: Kind, at: Point, size_m: tuple[float, float, float], rgb: Rgb) -> Solid:
    """A thing of full size `size_m` that stands on the floor at `at`."""
    return Solid(
        name=name,
        kind=kind,
        centre_m=(at[0], at[1], size_m[2] / 2),
        half_m=(size_m[0] / 2, size_m[1] / 2, size_m[2] / 2),
        rgb=rgb,
    )


def sign(text: str, at_m: tuple[float, float, float], *, facing_rad: float, size_m: Point) -> Solid:
    """A white plate with `text`, `size_m` wide and high, whose front looks along `facing_rad` (map frame)."""
    return Solid(
        name=f"sign-{text}",
        kind="sign",
        centre_m=at_m,
        half_m=(0.01, size_m[0] / 2, size_m[1] / 2),
        rgb=(0.95, 0.95, 0.93),
        yaw_rad=facing_rad,
        text=text,
    )
