"""Shapes the form that adds or changes a place, and reads a place from what was typed."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, hypot, isfinite

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from app.views.editor_fields import FieldValue, Version
from app.views.forms import Wrong
from app.views.places import SiteMap, site_map
from app.views.shell import Shell
from harness.contracts.places import Place, Site

SLUG = re.compile(r"[a-z][a-z0-9_]{0,39}")
NEAR_M = 0.4


@dataclass(frozen=True)
class PlaceForm:
    """The editor. `basis` is the revision it was filled from; `spot` is where the place stands on the map."""

    shell: Shell
    place_id: str
    new: bool
    basis: int
    removed: bool
    frame: str
    map_version: str
    identifier: FieldValue
    name: FieldValue
    aliases: FieldValue
    x: FieldValue
    y: FieldValue
    heading: FieldValue
    region: FieldValue
    verification: FieldValue
    reason: FieldValue
    errors: tuple[str, ...]
    warnings: tuple[str, ...]
    versions: tuple[Version, ...]
    map: SiteMap
    spot_x: float
    spot_y: float


def fields_of(place: Place) -> dict[str, str]:
    """A place as the form's fields show it."""
    return {
        "place_id": place.place_id,
        "name": place.name,
        "aliases": ", ".join(place.aliases),
        "x": f"{place.approach_m[0]:g}",
        "y": f"{place.approach_m[1]:g}",
        "heading": f"{degrees(place.yaw_rad):.1f}".rstrip("0").rstrip("."),
        "region": "; ".join(f"{x:g}, {y:g}" for x, y in place.region_m),
        "verification": place.verification,
    }


def place_form(
    shell: Shell,
    site: Site,
    typed: Mapping[str, str],
    *,
    basis: int,
    wrong: Sequence[Wrong] = (),
    versions: Sequence[Version] = (),
    new: bool = False,
) -> PlaceForm:
    """The form as the person left it."""
    beside = {one.field: one.text for one in wrong if one.field}

    def of(name: str, default: str = "") -> FieldValue:
        return FieldValue(value=typed.get(name, default), wrong=beside.get(name, ""))

    x, y = _number(typed.get("x", "")), _number(typed.get("y", ""))
    place_id = typed.get("place_id", "")
    return PlaceForm(
        shell=shell,
        place_id=place_id,
        new=new,
        basis=basis,
        removed=not new and all(one.place_id != place_id for one in site.places),
        frame=site.frame,
        map_version=site.map_version,
        identifier=of("place_id"),
        name=of("name"),
        aliases=of("aliases"),
        x=of("x"),
        y=of("y"),
        heading=of("heading", "0"),
        region=of("region"),
        verification=of("verification", "configured"),
        reason=of("reason"),
        errors=tuple(one.text for one in wrong),
        warnings=_far_routes(site, place_id, x, y),
        versions=tuple(versions),
        map=site_map(site),
        spot_x=x if x is not None else 0.0,
        spot_y=-y if y is not None else 0.0,
    )


def wrong_names(place_id: str, words: Sequence[str], site: Site) -> list[Wrong]:
    """What is wrong with the identifier, and with a word that names two places: it names none."""
    if not SLUG.fullmatch(place_id):
        return [Wrong("place_id", N_("An identifier is small letters, digits and _, and begins with a letter."))]
    others = {
        word.casefold(): one.name
        for one in site.places
        if one.place_id != place_id
        for word in (one.place_id, one.name, *one.aliases)
    }
    twice = [word for word in words if word.casefold() in others]
    return [
        Wrong(
            "aliases" if word != words[0] else "name",
            lazy_gettext("“{word}” names {other} already.", word=word, other=others[word.casefold()]),
        )
        for word in twice
    ]


def _far_routes(site: Site, place_id: str, x: float | None, y: float | None) -> tuple[str, ...]:
    """Reference routes that lead to where the place used to be."""
    if x is None or y is None:
        return ()
    ends = [(route, route.waypoints_m[-1]) for route in site.routes if route.end == place_id]
    ends += [(route, route.waypoints_m[0]) for route in site.routes if route.start == place_id]
    return tuple(
        lazy_gettext(
            "Route {route} has its end {distance} m from here: survey it again.",
            route=route.name,
            distance=f"{hypot(at[0] - x, at[1] - y):.2f}",
        )
        for route, at in ends
        if hypot(at[0] - x, at[1] - y) > NEAR_M
    )


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if isfinite(number) else None
