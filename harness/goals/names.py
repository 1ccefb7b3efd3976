"""The site's own names in a goal: places, routes, passages, zones and channels, each with its aliases. Pure."""

from collections.abc import Iterator

from harness.contracts.errors import ContractInvalid
from harness.contracts.places import Place, Route, Site
from harness.contracts.readings import ClauseObject, ObjectKind
from harness.contracts.reasons import because
from harness.goals.tokens import folded
from harness.goals.words import Meaning


def check_names(site: Site) -> None:
    """Raise ContractInvalid where one name stands for two places, routes, passages or channels: no goal could say
    which."""
    known: dict[tuple[str, ...], ClauseObject] = {}
    for text, target in _named(site):
        key = _key(text)
        other = known.setdefault(key, target)
        if key and other != target:
            raise ContractInvalid(
                because(
                    "name_of_two",
                    name=text[:80],
                    kind=other.kind,
                    id=other.id,
                    other_kind=target.kind,
                    other_id=target.id,
                ),
                where=because("at_aliases", site=site.name, first=other.id, second=target.id),
            )


def site_names(site: Site) -> Iterator[tuple[str, Meaning]]:
    """Every name as a phrase of the grammar; a zone gives way to a place, route or passage of the same name.

    Raises as `check_names` does.
    """
    check_names(site)
    for text, target in _named(site):
        yield from _forms(text, target)
    for zone in site.zones:
        for text in (zone.name, f"{zone.name} zone"):
            yield from _forms(text, ClauseObject(kind="region", id=zone.name, name=zone.name))


def object_of_place(place: Place) -> ClauseObject:
    """A place as a clause names it."""
    return ClauseObject(kind="place", id=place.place_id, name=place.name)


def object_of_route(route: Route) -> ClauseObject:
    """A route as a clause names it."""
    return ClauseObject(kind="route", id=route.name, name=route.name)


def known_object(target: ClauseObject, site: Site) -> bool:
    """Whether the site has what a clause is about."""
    ids: dict[ObjectKind, set[str]] = {
        "place": {place.place_id for place in site.places},
        "route": {route.name for route in site.routes},
        "passage": {passage.passage_id for passage in site.passages},
        "region": {zone.name for zone in site.zones},
        "channel": {channel.name for channel in site.channels},
    }
    return target.id in ids[target.kind] if target.kind in ids else not target.id


def _forms(text: str, target: ClauseObject) -> Iterator[tuple[str, Meaning]]:
    word = Meaning("name", object=target)
    bare = " ".join(_key(text))
    if not bare:
        return
    yield bare, word
    if bare.isascii():
        yield f"the {bare}", word


def _named(site: Site) -> Iterator[tuple[str, ClauseObject]]:
    for place in site.places:
        target = object_of_place(place)
        yield from ((text, target) for text in (place.place_id, place.name, *place.aliases))
    for passage in site.passages:
        target = ClauseObject(kind="passage", id=passage.passage_id, name=_spoken(passage.passage_id))
        yield from ((text, target) for text in (passage.passage_id, *(passage.aliases or ())))
    for route in site.routes:
        target = object_of_route(route)
        yield from ((text, target) for text in (route.name, *(route.aliases or ())))
    for channel in site.channels:
        target = ClauseObject(kind="channel", id=channel.name, name=(*channel.aliases, channel.name)[0])
        yield from ((text, target) for text in (channel.name, *channel.aliases))


def _spoken(name: str) -> str:
    return name.replace("_", " ")


def _key(text: str) -> tuple[str, ...]:
    key = folded(text)
    return key[1:] if key[:1] == ("the",) and len(key) > 1 else key
