"""Shapes the form that adds or changes a reference route."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from msgspec import UNSET

from app.i18n.messages import reasoned
from app.views.editor_fields import FieldValue, Version
from app.views.forms import SelectOption, Wrong
from app.views.places import SiteMap, site_map
from app.views.shell import Shell
from app.views.svg_floor import polyline
from harness.contracts.places import Route, Site
from harness.contracts.reasons import Reason

FIELDS = {"waypoints_m": "waypoints"}
"""What the fields of a route are called on the form."""


@dataclass(frozen=True)
class RouteForm:
    """The editor. `basis` is the revision it was filled from; `line` draws the waypoints on the map."""

    shell: Shell
    route: str
    new: bool
    basis: int
    removed: bool
    frame: str
    map_version: str
    identifier: FieldValue
    start: FieldValue
    end: FieldValue
    starts: tuple[SelectOption, ...]
    ends: tuple[SelectOption, ...]
    waypoints: FieldValue
    aliases: FieldValue
    reason: FieldValue
    errors: tuple[str, ...]
    versions: tuple[Version, ...]
    map: SiteMap
    line: str


def fields_of(route: Route) -> dict[str, str]:
    """A route as the form's fields show it."""
    aliases = () if route.aliases is UNSET else route.aliases
    return {
        "name": route.name,
        "start": route.start,
        "end": route.end,
        "waypoints": "; ".join(f"{x:g}, {y:g}" for x, y in route.waypoints_m),
        "aliases": ", ".join(aliases),
    }


def route_form(
    shell: Shell,
    site: Site,
    typed: Mapping[str, str],
    *,
    basis: int,
    wrong: Sequence[Wrong] = (),
    versions: Sequence[Version] = (),
    new: bool = False,
) -> RouteForm:
    """The form as the person left it."""
    beside = {one.field: one.text for one in wrong if one.field}

    def of(name: str) -> FieldValue:
        return FieldValue(value=typed.get(name, ""), wrong=beside.get(name, ""))

    def places(chosen: str) -> tuple[SelectOption, ...]:
        return tuple(SelectOption(one.place_id, one.name, one.place_id == chosen) for one in site.places)

    name = typed.get("name", "")
    return RouteForm(
        shell=shell,
        route=name,
        new=new,
        basis=basis,
        removed=not new and all(one.name != name for one in site.routes),
        frame=site.frame,
        map_version=site.map_version,
        identifier=of("name"),
        start=of("start"),
        end=of("end"),
        starts=places(typed.get("start", "")),
        ends=places(typed.get("end", "")),
        waypoints=of("waypoints"),
        aliases=of("aliases"),
        reason=of("reason"),
        errors=tuple(one.text for one in wrong),
        versions=tuple(versions),
        map=site_map(site),
        line=polyline(_drawn(typed.get("waypoints", ""))),
    )


def wrong_fields(refusals: Iterable[tuple[Reason, str]]) -> list[Wrong]:
    """Why a route may not be saved, beside the fields of its form."""
    return [Wrong(FIELDS.get(key, key), reasoned(reason)) for reason, key in refusals]


def _drawn(text: str) -> list[tuple[float, float]]:
    """The waypoints that can be read of what was typed."""
    points = []
    for part in text.split(";"):
        numbers = part.split(",")
        try:
            points.append((float(numbers[0]), float(numbers[1])))
        except (ValueError, IndexError):
            continue
    return points
