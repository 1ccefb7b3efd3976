"""Checks a site's folder after its types: names, routes, walls, zones, robots and missions. Reads no file."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import dist, hypot
from pathlib import Path

from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.exploration import FREE, OCCUPIED, GridMap
from harness.contracts.places import Place, Route, Site
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import CURRENT_RULES
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Point
from harness.exploration.grid import cell_of
from harness.goals.names import check_names
from harness.goals.sources import world_sources
from harness.planning.compile import compile_contract
from harness.supervisor.zones import ARRIVED_M, way_of
from harness.workspace.contract_yaml import Lines, Step
from harness.workspace.files import HttpRobotEntry, RobotsFile, SecretReference

STEP_M = 0.05


def at(file: Path, line: int) -> str:
    """Where a problem stands, as an editor opens it."""
    return f"{file}:{line}"


def relocated(error: HarnessError, file: Path, line: int) -> HarnessError:
    """The same error at its place in the folder."""
    return type(error)(error.what, where=at(file, line), do=error.do)


def site_problems(site: Site, file: Path, lines: Lines, floor: GridMap | None) -> Iterator[HarnessError]:
    """Everything that is wrong with the places, routes and zones of a site."""

    def problem(reason: Reason, *path: Step) -> ContractInvalid:
        return ContractInvalid(reason, where=at(file, lines.of(*path)))

    yield from _twice([("places", [one.place_id for one in site.places]), ("routes", [one.name for one in site.routes]),
                       ("passages", [one.passage_id for one in site.passages]),
                       ("zones", [one.name for one in site.zones])], problem)  # fmt: skip
    try:
        check_names(site)
    except ContractInvalid as error:
        yield relocated(error, file, lines.of(*_named_second(site, error)))
    places = {one.place_id: one for one in site.places}
    groups: tuple[tuple[str, tuple[Place | Route, ...]], ...] = (("places", site.places), ("routes", site.routes))
    for kind, records in groups:
        for index, one in enumerate(records):
            if (one.frame, one.map_version) != (site.frame, site.map_version):
                yield problem(because("other_map_than_site", frame=one.frame, map_version=one.map_version), kind, index)
    for index, place in enumerate(site.places):
        if floor is not None and _cell(floor, place.approach_m) != FREE:
            yield problem(because("place_not_on_floor", place_id=place.place_id), "places", index, "approach_m")
    for index, route in enumerate(site.routes):
        if len(route.waypoints_m) < 2:
            yield problem(because("route_too_short", route=route.name), "routes", index, "waypoints_m")
            continue
        for end, point, key in (
            (route.start, route.waypoints_m[0], "start"),
            (route.end, route.waypoints_m[-1], "end"),
        ):
            if end not in places:
                yield problem(because("route_end_unknown", route=route.name, place_id=end), "routes", index, key)
            elif (beside_m := dist(point, places[end].approach_m)) > ARRIVED_M:
                yield problem(
                    because("route_end_elsewhere", route=route.name, place_id=end, beside_m=beside_m),
                    "routes",
                    index,
                    key,
                )
        wall = _wall(floor, route.waypoints_m) if floor else None
        if wall is not None:
            yield problem(
                because("route_through_wall", route=route.name, x_m=wall[0], y_m=wall[1]),
                "routes",
                index,
                "waypoints_m",
            )
    for index, zone in enumerate(site.zones):
        if zone.retreat is not None or zone.no_answer == "retreat":
            try:
                way_of(site, zone)
            except ContractInvalid as error:
                yield relocated(error, file, lines.of("zones", index, "retreat"))
    if site.profile and site.profile.home not in places:
        yield problem(because("home_place_unknown", place_id=site.profile.home), "profile", "home")
    known = world_sources()
    for index, name in enumerate(site.vouched):
        if name not in known:
            yield problem(because("vouched_unknown", name=name, names=tuple(sorted(known))), "vouched", index)


def robot_problems(robots: RobotsFile, file: Path, lines: Lines) -> Iterator[HarnessError]:
    """Robots of one name or address, and entries that say half of what they must."""

    def problem(reason: Reason, *path: Step) -> ContractInvalid:
        return ContractInvalid(reason, where=at(file, lines.of(*path)))

    yield from _twice([("robots", [one.name for one in robots.robots])], problem)
    addresses: dict[str, str] = {}
    for index, one in enumerate(robots.robots):
        if not isinstance(one, HttpRobotEntry):
            continue
        other = addresses.setdefault(one.address.rstrip("/"), one.name)
        if other != one.name:
            yield problem(because("address_of_two", name=one.name, other=other), "robots", index, "address")
        if bool(one.token.environment) == bool(one.token.file):
            yield problem(because("secret_needs_one_place"), "robots", index, "token")
        if one.footprint_m and len(one.footprint_m) < 3:
            yield problem(because("footprint_too_small", name=one.name), "robots", index, "footprint_m")


def robot_notes(
    robots: RobotsFile, folder: Path, lines: Lines, *, has_secret: Callable[[SecretReference], bool]
) -> Iterator[ContractInvalid]:
    """A token that is not there yet: the robot cannot be connected, and everything else can be checked."""
    for index, one in enumerate(robots.robots):
        if isinstance(one, HttpRobotEntry) and not has_secret(one.token):
            named = one.token.environment or one.token.file
            yield ContractInvalid(
                because("token_not_there", name=one.name, reference=named),
                where=at(folder / "robots.yaml", lines.of("robots", index, "token")),
            )


def mission_problems(template: TaskTemplate, site: Site, file: Path, lines: Lines) -> Iterator[HarnessError]:
    """Why the mission could not be started as it stands, with its defaults, at this site."""
    if any(parameter.default is None for parameter in template.parameters):
        return
    try:
        compile_contract(goal=template.goal, template=template, arguments={}, site=site, rules=CURRENT_RULES)
    except HarnessError as error:
        named = [
            index
            for index, parameter in enumerate(template.parameters)
            if parameter.name in str(error.where) or str(parameter.default) in str(error)
        ]
        path: tuple[Step, ...] = ("parameters", named[0], "default") if named else ("nodes",)
        yield relocated(error, file, lines.of(*path))


def speed_notes(
    missions: Sequence[tuple[TaskTemplate, Path, Lines]], robots: RobotsFile, folder: Path
) -> Iterator[ContractInvalid]:
    """Missions that ask for more speed than a robot of the site takes: its provider is refused for them."""
    limits = [(one.name, one.speed_limit_mps) for one in robots.robots if isinstance(one, HttpRobotEntry)]
    for template, file, lines in missions:
        cap_mps = template.constraints.get("speed_cap_mps")
        for name, limit in limits:
            if limit is not None and isinstance(cap_mps, int | float) and cap_mps > limit:
                yield ContractInvalid(
                    because(
                        "mission_too_fast", mission=template.name, asked_mps=float(cap_mps), name=name, limit_mps=limit
                    ),
                    where=at(file, lines.of("constraints", "speed_cap_mps")),
                )


def clearance_problems(
    site: Site, robots: RobotsFile, file: Path, lines: Lines, floor: GridMap
) -> Iterator[HarnessError]:
    """Routes that pass a wall nearer than half the width of a robot of this site."""
    for one in robots.robots:
        half_m = _half_width_m(one.footprint_m) if isinstance(one, HttpRobotEntry) else 0.0
        for index, route in enumerate(site.routes) if half_m else ():
            near = _wall(floor, route.waypoints_m, within_m=half_m)
            if near is not None and _wall(floor, route.waypoints_m) is None:
                yield ContractInvalid(
                    because(
                        "route_too_narrow", route=route.name, name=one.name, half_m=half_m, x_m=near[0], y_m=near[1]
                    ),
                    where=at(file, lines.of("routes", index, "waypoints_m")),
                )


def _twice(
    groups: Sequence[tuple[str, Sequence[str]]], problem: Callable[..., ContractInvalid]
) -> Iterator[ContractInvalid]:
    for group, names in groups:
        for index, name in enumerate(names):
            if name in names[:index]:
                yield problem(because("name_stands_twice", name=name), group, index)


def _named_second(site: Site, error: HarnessError) -> tuple[Step, ...]:
    """Where the second of two things of one name stands."""
    facts = error.reason.facts
    kind, name = facts.get("other_kind"), facts.get("other_id")
    groups: dict[object, tuple[str, list[str]]] = {
        "place": ("places", [one.place_id for one in site.places]),
        "route": ("routes", [one.name for one in site.routes]),
        "passage": ("passages", [one.passage_id for one in site.passages]),
    }
    group, names = groups.get(kind, ("places", []))
    return (group, names.index(str(name)), "aliases") if name in names else (group,)


def _wall(floor: GridMap, waypoints: Sequence[Point], *, within_m: float = 0.0) -> Point | None:
    """The first point of a route on, or within so many metres of, occupied floor or outside of the map."""
    reach = int(within_m / floor.cell_m)
    around = [
        (down, right)
        for down in range(-reach, reach + 1)
        for right in range(-reach, reach + 1)
        if hypot(down, right) * floor.cell_m <= within_m
    ]
    for start, end in pairwise(waypoints):
        steps = max(1, int(dist(start, end) / min(STEP_M, floor.cell_m)))
        for step in range(steps + 1):
            point = (
                start[0] + (end[0] - start[0]) * step / steps,
                start[1] + (end[1] - start[1]) * step / steps,
            )
            row, column = cell_of(floor, point)
            if _value(floor, row, column) is None:
                return point
            if any(_value(floor, row + down, column + right) == OCCUPIED for down, right in around):
                return point
    return None


def _cell(floor: GridMap, point: Point) -> int | None:
    return _value(floor, *cell_of(floor, point))


def _value(floor: GridMap, row: int, column: int) -> int | None:
    """What is known of a cell; None outside of the map."""
    inside = 0 <= row < floor.rows and 0 <= column < floor.columns
    return floor.cells[row * floor.columns + column] if inside else None


def _half_width_m(footprint: Sequence[Point]) -> float:
    """Half of the narrower side: what a body needs on both sides of its way."""
    if len(footprint) < 3:
        return 0.0
    xs, ys = [x for x, _ in footprint], [y for _, y in footprint]
    return min(max(xs) - min(xs), max(ys) - min(ys)) / 2
