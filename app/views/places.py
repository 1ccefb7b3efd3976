"""Shapes the places that words like "the storage" mean, with their verification, on a map drawn to scale."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, word
from app.views.shell import Shell
from app.views.svg_floor import polyline, view_box
from harness.contracts.ids import PlaceId
from harness.contracts.places import Retreat, Route, Site
from harness.contracts.values import Point

MARGIN_M = 1.0
LEAST_M = (20.0, 10.0)
"""A smaller site is drawn with more around it: names are written in metres, and would fill its map."""
TONES = {"verified": "good", "disputed": "bad"}
MEANING = {
    "configured": N_("written down by people, not seen by a robot"),
    "verified": N_("confirmed on site"),
    "disputed": N_("contradicted: do not rely on it"),
}


@dataclass(frozen=True)
class MapShape:
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
    shapes: tuple[MapShape, ...]
    anchors: tuple[MapShape, ...]


@dataclass(frozen=True)
class PlacesPage:
    """All places of the site."""

    shell: Shell
    site: Site
    map: SiteMap


def site_map(site: Site) -> SiteMap:
    """Zones, passages, regions, routes and places, in this order, so that the small stands on the large."""
    outlines = [
        *((lazy_gettext("zone {name}", name=one.name), "zone", one.region_m) for one in site.zones),
        *((one.name, "region", one.region_m) for one in site.places if one.region_m),
        *((word(one.passage_id), "passage", one.floor_m) for one in site.passages),
    ]
    lines = [(lazy_gettext("route {name}", name=one.name), "route", one.waypoints_m) for one in site.routes]
    spots = [(one.name, one.approach_m) for one in site.places]
    every = [point for _, _, points in (*outlines, *lines) for point in points] + [at for _, at in spots]
    xs, ys = [p[0] for p in every] or [0.0], [p[1] for p in every] or [0.0]
    _, width, height = view_box(xs, ys, margin_m=MARGIN_M)
    box, _, _ = view_box(_widened(xs, LEAST_M[0]), _widened(ys, LEAST_M[1]), margin_m=MARGIN_M)
    return SiteMap(
        box=box,
        width_m=width,
        height_m=height,
        shapes=tuple(_shape(name, kind, points) for name, kind, points in (*outlines, *lines)),
        anchors=tuple(_shape(name, "anchor", (at,)) for name, at in spots),
    )


def _widened(values: Sequence[float], least_m: float) -> tuple[float, float]:
    """The smallest and the largest, at least so far apart, with the same middle."""
    low, high = min(values), max(values)
    more_m = max(0.0, least_m - (high - low)) / 2
    return low - more_m, high + more_m


def _shape(name: str, kind: str, points: Sequence[Point]) -> MapShape:
    x, y = sum(p[0] for p in points) / len(points), -sum(p[1] for p in points) / len(points)
    return MapShape(name=name, kind=kind, points=polyline(points), x=x, y=y)


def length_m(route: Route) -> float:
    """The length of a route from its first waypoint to its last, in metres."""
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(route.waypoints_m))


def place_name(site: Site, place_id: PlaceId) -> str:
    """A place's own name; its id as words where the site has no such place."""
    return next((one.name for one in site.places if one.place_id == place_id), word(place_id))


def safe_place(retreat: Retreat, site: Site) -> str:
    """Where a zone sends its robot if nobody answers, by which route and on whose authority."""
    return lazy_gettext(
        "safe place {place} by {route}, at most {speed} m/s, authorised by {authority} on {day}",
        place=place_name(site, retreat.place_id),
        route=retreat.route,
        speed=retreat.speed_cap_mps,
        authority=retreat.authorised_by,
        day=retreat.authorised_on,
    )
