"""Places: names that people use, bound to geometry. Configured mission semantics, never perceived facts (R194)."""

from typing import Annotated, Literal

import msgspec

from harness.contracts.ids import PlaceId
from harness.contracts.values import Name, Point, Positive, Value

Otherwise = Literal["hold", "lie_down"]
"""What a robot does where it is, when it cannot go to a safe place."""


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
    aliases: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET


class Passage(Value):
    """A stretch of floor that inspections look at: a polygon on the floor in `frame`, metres."""

    passage_id: PlaceId
    frame: Name
    floor_m: tuple[Point, ...]
    aliases: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET


class Retreat(Value):
    """The zone's safe place and the one approved path to it, with its speed limit and the fallback (D27).

    A person authorised it beforehand, by name and day. The path is the part of `route` that lies ahead of the robot;
    where it cannot be taken the robot does `otherwise`.
    """

    place_id: PlaceId
    route: Name
    speed_cap_mps: Annotated[float, msgspec.Meta(gt=0, le=0.5)]
    otherwise: Otherwise
    authorised_by: Name
    authorised_on: Annotated[str, msgspec.Meta(pattern=r"^\d{4}-\d{2}-\d{2}$")]


class Zone(Value):
    """What happens to a robot in this region when a person does not answer (D27). A zone that says `retreat` has one.

    With another `no_answer` a declared `retreat` serves only people who send the robot to its safe place.
    """

    name: Name
    frame: Name
    region_m: tuple[Point, ...]
    no_answer: Literal["hold", "lie_down", "retreat"]
    hold_limit_s: Positive
    retreat: Retreat | None = None


class MissionProfile(Value):
    """What a mission at this site does without being asked: `defaults`; a goal may leave out those in `removable`.

    `home` is where a return leads when the goal names no place.
    """

    home: PlaceId
    defaults: tuple[Literal["return", "report"], ...] = ("return", "report")
    removable: tuple[Literal["return", "report"], ...] = ()


class SiteChannel(Value):
    """Where messages of this site can be sent, as goals name it; its addresses and secrets are no part of the site.

    `readable`: what it holds can be read back by the harness's own client (D46); of any other channel a delivery is
    declared by its service and no more. `default`: it takes what no goal addresses.
    """

    name: Name
    aliases: tuple[Name, ...] = ()
    readable: bool = False
    default: bool = False


class Site(Value):
    """All places, routes, passages and zones of one map version, and the channels that messages are sent to.

    `wake_phrases`: what a person may say before a spoken command; it is no part of the goal.

    `vouched`: sources that the site's operator declares to be of separate origin, though one process or address
    delivers them together with others (D17).
    """

    name: Name
    frame: Name
    map_version: Name
    places: tuple[Place, ...]
    routes: tuple[Route, ...]
    passages: tuple[Passage, ...] = ()
    zones: tuple[Zone, ...] = ()
    vouched: tuple[Name, ...] = ()
    profile: MissionProfile | msgspec.UnsetType = msgspec.UNSET
    channels: tuple[SiteChannel, ...] = ()
    wake_phrases: tuple[Name, ...] = ("xiao wei",)
