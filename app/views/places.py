"""Pure: the places that words like "the storage" mean, with their verification, on a small map drawn to scale."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot

from app.messages import N_, lazy_gettext, word
from app.views.drawn import polyline, view_box
from app.views.shell import Shell
from harness.contracts.places import Place, Retreat, Route, Site, Zone
from harness.contracts.values import Point

MARGIN_M = 1.0
MEANING = {
    "configured": N_("written down by people, not seen by a robot"),
    "verified": N_("confirmed on site"),
    "disputed": N_("contradicted: do not rely on it"),
}


@dataclass(frozen=True)
class PlaceRow:
    """One place."""

    place_id: str
    name: str
    aliases: str
    x_m: float
    y_m: float
    yaw_deg: float
    frame: str
    map_version: str
    verification: str
    meaning: str
    tone: str
    provenance: str


@dataclass(frozen=True)
class RouteRow:
    """One reference route with its length."""

    name: str
    start: str
    end: str
    points: int
    length_m: float


@dataclass(frozen=True)
class ZoneRow:
    """One zone, what its robot does when nobody answers, and its safe place, empty without one."""

    name: str
    no_answer: str
    hold_limit_s: float
    safe_place: str


@dataclass(frozen=True)
class Shape:
    """One outline or line of the map, as SVG points, with its name and where to write it."""

    name: str
    kind: str
    points: str
    x: float
    y: float


@dataclass(frozen=True)
class SiteMap:
    """The map in metres, its y axis turned so that north is up."""

    box: str
    width_m: float
    height_m: float
    shapes: tuple[Shape, ...]
    anchors: tuple[Shape, ...]


@dataclass(frozen=True)
class PlacesPage:
    """All places of the site."""

    shell: Shell
    site: str
    frame: str
    map_version: str
    places: tuple[PlaceRow, ...]
    routes: tuple[RouteRow, ...]
    zones: tuple[ZoneRow, ...]
    map: SiteMap


def places_page(shell: Shell, site: Site) -> PlacesPage:
    return PlacesPage(
        shell=shell,
        site=site.name,
        frame=site.frame,
        map_version=site.map_version,
        places=tuple(_place(one) for one in site.places),
        routes=tuple(_route(one) for one in site.routes),
        zones=tuple(_zone(one) for one in site.zones),
        map=site_map(site),
    )


def site_map(site: Site) -> SiteMap:
    """Zones, passages, regions, routes and places, in this order, so that the small stands on the large."""
    outlines = [
        *((lazy_gettext("zone {name}", name=one.name), "zone", one.region_m) for one in site.zones),
        *((one.name, "region", one.region_m) for one in site.places if one.region_m),
        *((word(one.passage_id), "passage", one.floor_m) for one in site.passages),
    ]
    lines = [(one.name, "route", one.waypoints_m) for one in site.routes]
    spots = [(one.name, one.approach_m) for one in site.places]
    every = [point for _, _, points in (*outlines, *lines) for point in points] + [at for _, at in spots]
    xs, ys = [p[0] for p in every] or [0.0], [p[1] for p in every] or [0.0]
    box, width, height = view_box(xs, ys, margin_m=MARGIN_M)
    return SiteMap(
        box=box,
        width_m=width,
        height_m=height,
        shapes=tuple(_shape(name, kind, points) for name, kind, points in (*outlines, *lines)),
        anchors=tuple(_shape(name, "anchor", (at,)) for name, at in spots),
    )


def _shape(name: str, kind: str, points: Sequence[Point]) -> Shape:
    x, y = sum(p[0] for p in points) / len(points), -sum(p[1] for p in points) / len(points)
    return Shape(name=name, kind=kind, points=polyline(points), x=x, y=y)


def _place(place: Place) -> PlaceRow:
    return PlaceRow(
        place_id=place.place_id,
        name=place.name,
        aliases=", ".join(place.aliases),
        x_m=place.approach_m[0],
        y_m=place.approach_m[1],
        yaw_deg=place.yaw_rad * 57.29578,
        frame=place.frame,
        map_version=place.map_version,
        verification=place.verification,
        meaning=MEANING[place.verification],
        tone={"verified": "good", "disputed": "bad"}.get(place.verification, "plain"),
        provenance=place.provenance,
    )


def _route(route: Route) -> RouteRow:
    length = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(route.waypoints_m))
    return RouteRow(name=route.name, start=route.start, end=route.end, points=len(route.waypoints_m), length_m=length)


def _zone(zone: Zone) -> ZoneRow:
    return ZoneRow(
        name=zone.name,
        no_answer=word(zone.no_answer),
        hold_limit_s=zone.hold_limit_s,
        safe_place=_safe_place(zone.retreat) if zone.retreat else "",
    )


def _safe_place(retreat: Retreat) -> str:
    return lazy_gettext(
        "safe place {place} by {route}, at most {speed} m/s, authorised by {authority} on {day}",
        place=word(retreat.place_id),
        route=retreat.route,
        speed=retreat.speed_cap_mps,
        authority=retreat.authorised_by,
        day=retreat.authorised_on,
    )
