"""Places: names that people use, bound to geometry. Configured mission semantics, never perceived facts (R194)."""

from typing import Literal

from harness.contracts.ids import PlaceId
from harness.contracts.values import Name, Point, Positive, Value


class Place(Value):
    """One place record (R191). `approach_m` in `frame`; `yaw_rad` is the heading on arrival."""

    place_id: PlaceId
    name: Name
    frame: Name
    map_version: Name
    approach_m: Point
    provenance: Name
    verification: Literal["configured", "verified", "disputed"]
    aliases: tuple[str, ...] = ()
    yaw_rad: float = 0.0
    region_m: tuple[Point, ...] = ()


class Route(Value):
    """A reference route: commanded waypoints in `frame`, metres. Its length is L_ref (R209)."""

    name: Name
    frame: Name
    map_version: Name
    start: PlaceId
    end: PlaceId
    waypoints_m: tuple[Point, ...]


class Passage(Value):
    """A stretch of floor that inspections look at: a polygon on the floor in `frame`, metres."""

    passage_id: PlaceId
    frame: Name
    floor_m: tuple[Point, ...]


class Zone(Value):
    """What happens to a robot in this region when a person does not answer (D27)."""

    name: Name
    frame: Name
    region_m: tuple[Point, ...]
    no_answer: Literal["hold", "lie_down", "retreat"]
    hold_limit_s: Positive


class Site(Value):
    """All places, routes, passages and zones of one map version."""

    name: Name
    frame: Name
    map_version: Name
    places: tuple[Place, ...]
    routes: tuple[Route, ...]
    passages: tuple[Passage, ...] = ()
    zones: tuple[Zone, ...] = ()
