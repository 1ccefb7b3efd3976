"""Binds place names and template parameters to values. Pure: knows no task, no robot and no clock."""

import math
import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, Literal

from msgspec.structs import replace

from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.places import Passage, Place, Route, Site, Zone
from harness.contracts.reasons import Explanation, because
from harness.projections.region import contains

Sigil = Literal["$", "@"]
"""`${name.field}` is bound when a contract is compiled, `@{node.argument}` from committed facts at dispatch."""

_SPOT: dict[str, re.Pattern[str]] = {
    sigil: re.compile(rf"\{sigil}\{{((?:[0-9]+\.)?[a-z][a-z0-9_-]*)(?:\.([a-z][a-z0-9_]*))?\}}") for sigil in ("$", "@")
}


def bind_place(name: str, *, site: Site) -> Place:
    """The one place of that id, name or alias, whatever its case.

    Raises UnknownName with the nearest name, ContractInvalid if two places match it or the place is disputed.
    """
    folded = _folded(name)
    found = [place for place in site.places if folded in {_folded(word) for word in _words(place)}]
    if not found:
        raise unknown("place", name, known=[word for place in site.places for word in _words(place)], where=site.name)
    if len(found) > 1:
        raise ContractInvalid(
            because("place_ambiguous", count=len(found), name=name[:80], ids=tuple(place.place_id for place in found)),
            where=because("at_site", site=site.name),
        )
    if found[0].verification == "disputed":
        raise ContractInvalid(
            because("place_disputed", place_id=found[0].place_id), where=because("at_site", site=site.name)
        )
    return found[0]


def bind_route(start: Place, end: Place, *, site: Site) -> Route:
    """The first reference route from `start` to `end`; raises UnknownName if the site has none."""
    for route in site.routes:
        if (route.start, route.end) == (start.place_id, end.place_id):
            return route
    routes = tuple(because("route_between", name=route.name, start=route.start, end=route.end) for route in site.routes)
    raise UnknownName(
        because("no_route_between", start=start.place_id, end=end.place_id, routes=routes or "none"),
        where=because("at_site", site=site.name),
    )


def bind_way(place: Place, *, site: Site) -> Route:
    """How a leg ends at a place, wherever the body is before: the last stretch of a route that leads there.

    Raises UnknownName if the site has none.
    """
    for route in site.routes:
        if route.end == place.place_id != route.start:
            return replace(route, waypoints_m=route.waypoints_m[-2:])
    raise UnknownName(because("no_route_to", place_id=place.place_id), where=because("at_site", site=site.name))


def bind_passage(place: Place, *, site: Site) -> Passage:
    """The passage that belongs to a place: it lies within the place's region (D43); of several, the nearest.

    Raises UnknownName for a place without one: what is seen there says nothing about a passage elsewhere.
    """
    own = [passage for passage in site.passages if place_of(passage, site=site) == place]
    if not own:
        raise UnknownName(
            because("no_passage_within", place_id=place.place_id), where=because("at_site", site=site.name)
        )
    return min(own, key=lambda passage: (math.dist(_middle(passage), place.approach_m), passage.passage_id))


def place_of(passage: Passage, *, site: Site) -> Place | None:
    """The place whose region holds the whole passage; None if no place does."""
    return next(
        (
            place
            for place in site.places
            if len(place.region_m) > 2 and all(contains(place.region_m, point) for point in passage.floor_m)
        ),
        None,
    )


def bind_zone(place: Place, *, site: Site) -> Zone:
    """The first zone that holds the place's approach; raises UnknownName if none does."""
    for zone in site.zones:
        if contains(zone.region_m, place.approach_m):
            return zone
    raise UnknownName(because("no_zone_around", place_id=place.place_id), where=because("at_site", site=site.name))


def substitute(value: Any, *, bindings: Mapping[str, Any], sigil: Sigil = "$", path: str = "$") -> Any:
    """`value` with every placeholder filled. A placeholder that is the whole string keeps its value's type.

    Raises ContractInvalid that names a placeholder's path if it is malformed, unknown, or not a scalar inside a text.
    """
    match value:
        case Mapping():
            return {
                key: substitute(item, bindings=bindings, sigil=sigil, path=f"{path}.{key}")
                for key, item in value.items()
            }
        case list() | tuple():
            return [
                substitute(item, bindings=bindings, sigil=sigil, path=f"{path}[{index}]")
                for index, item in enumerate(value)
            ]
        case str() if f"{sigil}{{" in value:
            return _filled(value, bindings, sigil, path)
        case _:
            return value


def names_in(value: Any, *, sigil: Sigil = "$") -> frozenset[str]:
    """The names that the placeholders of `value` refer to."""
    match value:
        case Mapping():
            return names_in(list(value.values()), sigil=sigil)
        case list() | tuple():
            return frozenset().union(*(names_in(item, sigil=sigil) for item in value))
        case str():
            return frozenset(spot.group(1) for spot in _SPOT[sigil].finditer(value))
        case _:
            return frozenset()


def unknown(noun: str, name: str, *, known: Iterable[str], where: Explanation = "") -> UnknownName:
    """The error for an unknown name: lists what exists, and the nearest match."""
    names = sorted(set(known), key=str.casefold)
    near = get_close_matches(_folded(name), [_folded(word) for word in names], n=1, cutoff=0.6)
    nearest = next((word for word in names if near and _folded(word) == near[0]), None)
    known_names = tuple(names) or "none"
    if nearest is None:
        return UnknownName(because("name_unknown", kind=noun, name=name[:80], names=known_names), where=where)
    return UnknownName(
        because("name_misspelt", kind=noun, name=name[:80], nearest=nearest, names=known_names), where=where
    )


def _filled(text: str, bindings: Mapping[str, Any], sigil: Sigil, path: str) -> Any:
    pattern = _SPOT[sigil]
    if text.count(f"{sigil}{{") != len(pattern.findall(text)):
        raise ContractInvalid(
            because("spot_unreadable", text=text[:80], spot=f"{sigil}{{name}}", spot_of_field=f"{sigil}{{name.field}}"),
            where=path,
        )
    whole = pattern.fullmatch(text)
    if whole:
        return _value(whole, bindings, path)
    return pattern.sub(lambda spot: _scalar(spot, bindings, path), text)


def _value(spot: re.Match[str], bindings: Mapping[str, Any], path: str) -> Any:
    name, field = spot.group(1), spot.group(2)
    if name not in bindings:
        raise ContractInvalid(because("spot_unbound", spot=spot.group(), names=_listed(bindings)), where=path)
    if field is None:
        return bindings[name]
    fields = bindings[name]
    if not isinstance(fields, Mapping) or field not in fields:
        has = _listed(fields) if isinstance(fields, Mapping) else "none"
        raise ContractInvalid(because("spot_without_field", spot=spot.group(), name=name, fields=has), where=path)
    return fields[field]


def _scalar(spot: re.Match[str], bindings: Mapping[str, Any], path: str) -> str:
    value = _value(spot, bindings, path)
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ContractInvalid(because("spot_inside_text", spot=spot.group()), where=path)
    return str(value)


def _listed(names: Iterable[str]) -> tuple[str, ...] | str:
    return tuple(sorted(names)) or "none"


def _words(place: Place) -> tuple[str, ...]:
    return (place.place_id, place.name, *place.aliases)


def _folded(name: str) -> str:
    return " ".join(name.casefold().split())


def _middle(passage: Passage) -> tuple[float, float]:
    xs, ys = [x for x, _ in passage.floor_m], [y for _, y in passage.floor_m]
    return sum(xs) / len(xs), sum(ys) / len(ys)
