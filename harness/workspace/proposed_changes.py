"""Checks a route or a mission that somebody is about to save at a site, as `regen check` checks its files."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from harness.contracts import ports
from harness.contracts.capabilities import Vocabulary
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.exploration import GridMap
from harness.contracts.places import Route, Site
from harness.contracts.reasons import Reason, because
from harness.contracts.tasks import TaskTemplate
from harness.goals.names import check_names
from harness.workspace.checks import mission_problems, route_problems
from harness.workspace.contract_yaml import Lines, read_yaml

ROUTE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
MISSION_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,59}")


def route_refusals(route: Route, site: Site, floor: GridMap | None) -> Iterator[tuple[Reason, str]]:
    """Why the route may not be saved, and the field that it stands in; empty for none."""
    if not ROUTE_NAME.fullmatch(route.name) and all(one.name != route.name for one in site.routes):
        yield because("route_name_unusable"), "name"
        return
    yield from authorised_refusals(route.name, site)
    yield from route_problems(route, site, floor)
    others = tuple(one for one in site.routes if one.name != route.name)
    try:
        check_names(replace(site, routes=(*others, route)))
    except ContractInvalid as error:
        yield error.reason, "aliases"


def authorised_refusals(name: str, site: Site) -> Iterator[tuple[Reason, str]]:
    """A route by which a zone sends its robot to safety was authorised by name and day: no page changes it."""
    for zone in site.zones:
        if zone.retreat is not None and zone.retreat.route == name:
            who, day = zone.retreat.authorised_by, zone.retreat.authorised_on
            yield because("route_authorised", zone=zone.name, who=who, day=day), ""


def read_mission(
    text: str,
    *,
    name: str,
    known: bool,
    taken: Sequence[str],
    site: Site,
    vocabulary: Vocabulary,
    predicates: ports.Predicates,
) -> tuple[TaskTemplate | None, tuple[HarnessError, ...]]:
    """The mission, where it could be started here with its defaults; else everything that is wrong with its YAML.

    `name`: what it must be called; empty where its YAML says that. One that is not `known` may have no name that is
    `taken`. Anybody may have written the text, so that a process with limits reads it.
    """
    file = Path(f"{name or 'mission'}.yaml")
    try:
        template = read_yaml(text, TaskTemplate, where=str(file), foreign=True)
        _check_name(template.name, name, known=known, taken=taken, where=f"{file}:{Lines(text).of('name')}")
    except HarnessError as error:
        return None, (error,)
    problems = tuple(mission_problems(template, site, file, Lines(text), vocabulary=vocabulary, predicates=predicates))
    return (None if problems else template), problems


def _check_name(found: str, name: str, *, known: bool, taken: Sequence[str], where: str) -> None:
    """Raises ContractInvalid."""
    if name and found != name:
        raise ContractInvalid(because("mission_renamed", name=name, found=found[:80]), where=where)
    if not known and not MISSION_NAME.fullmatch(found):
        raise ContractInvalid(because("mission_name_unusable", name=found[:80]), where=where)
    if not known and found in taken:
        raise ContractInvalid(because("mission_name_taken", name=found[:80]), where=where)
