"""Checks a site's folder after its types: names, routes, walls, zones, robots and missions. Reads no file."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import dist, hypot
from pathlib import Path
from typing import assert_never
from urllib.parse import urlsplit

from harness.contracts import ports
from harness.contracts.capabilities import CapabilityType, Vocabulary
from harness.contracts.channels import ChannelsFile, is_readable, secrets_of
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.exploration import FREE, OCCUPIED, GridMap
from harness.contracts.ids import NodeId
from harness.contracts.places import Place, Route, Site
from harness.contracts.predicates import NO_PREDICATES
from harness.contracts.reasons import Reason, because
from harness.contracts.rules import CURRENT_RULES
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Point
from harness.exploration.grid import cell_of
from harness.goals.names import check_names
from harness.goals.predicates import with_pins
from harness.goals.satisfiable import check_satisfiable
from harness.goals.sources import world_sources
from harness.goals.vocabulary import problems
from harness.planning.clauses import tells_only
from harness.planning.compile import compile_contract, outcome_in_words
from harness.supervisor.zones import ARRIVED_M, way_of
from harness.verification.finding import RECEIPTS
from harness.verification.predicates.registry import PREDICATES
from harness.workspace.contract_yaml import Lines, Step
from harness.workspace.files import (
    EvidencePath,
    HttpRobotEntry,
    ModelsFile,
    RobotEntry,
    RobotsFile,
    SecretReference,
    SimulatedRobotEntry,
    VehicleEntry,
)

STEP_M = 0.05
SEEING_ROLES = frozenset({"visual_analysis", "description"})
"""Roles of models that are shown images."""
SCHEMES: dict[str, tuple[str, ...]] = {
    "http": ("http", "https"),
    "rosbridge": ("ws", "wss"),
    "foxglove": ("ws", "wss"),
    "dds": ("dds",),
}
"""The addresses that each kind of path for evidence has."""
LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})


def at(file: Path, line: int) -> str:
    """Where a problem stands, as an editor opens it."""
    return f"{file}:{line}"


def relocated(error: HarnessError, file: Path, line: int) -> HarnessError:
    """The same error at its place in the folder."""
    return type(error)(error.what, where=at(file, line), do=error.do)


def site_problems(
    site: Site, file: Path, lines: Lines, floor: GridMap | None, *, predicates: ports.Predicates = NO_PREDICATES
) -> Iterator[HarnessError]:
    """Everything that is wrong with the places, routes and zones of a site.

    It may vouch for sources, and for the installed `predicates` and the instruments that these read.
    """

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
        if floor is not None and floor_at(floor, place.approach_m) != FREE:
            yield problem(because("place_not_on_floor", place_id=place.place_id), "places", index, "approach_m")
    for index, route in enumerate(site.routes):
        for reason, key in route_problems(route, site, floor):
            yield problem(reason, "routes", index, key)
    for index, zone in enumerate(site.zones):
        if zone.retreat is not None or zone.no_answer == "retreat":
            try:
                way_of(site, zone)
            except ContractInvalid as error:
                yield relocated(error, file, lines.of("zones", index, "retreat"))
    if site.profile and site.profile.home not in places:
        yield problem(because("home_place_unknown", place_id=site.profile.home), "profile", "home")
    installed = predicates.installed
    known = world_sources() | set(installed)
    known |= {source for one in installed.values() for source in one.sources if source != RECEIPTS}
    for index, name in enumerate(site.vouched):
        if name not in known:
            yield problem(because("vouched_unknown", name=name, names=tuple(sorted(known))), "vouched", index)


def route_problems(route: Route, site: Site, floor: GridMap | None) -> Iterator[tuple[Reason, str]]:
    """What is wrong with a route at this site, and the field that it stands in."""
    if len(route.waypoints_m) < 2:
        yield because("route_too_short", route=route.name), "waypoints_m"
        return
    places = {one.place_id: one for one in site.places}
    for end, point, key in ((route.start, route.waypoints_m[0], "start"), (route.end, route.waypoints_m[-1], "end")):
        if end not in places:
            yield because("route_end_unknown", route=route.name, place_id=end), key
        elif (beside_m := dist(point, places[end].approach_m)) > ARRIVED_M:
            yield because("route_end_elsewhere", route=route.name, place_id=end, beside_m=beside_m), key
    wall = _wall(floor, route.waypoints_m) if floor else None
    if wall is not None:
        yield because("route_through_wall", route=route.name, x_m=wall[0], y_m=wall[1]), "waypoints_m"


def robot_problems(robots: RobotsFile, file: Path, lines: Lines) -> Iterator[HarnessError]:
    """Robots of one name or address, and entries that say half of what they must."""

    def problem(reason: Reason, *path: Step) -> ContractInvalid:
        return ContractInvalid(reason, where=at(file, lines.of(*path)))

    yield from _twice([("robots", [one.name for one in robots.robots])], problem)
    addresses: dict[str, str] = {}
    for index, one in enumerate(robots.robots):
        if isinstance(one, SimulatedRobotEntry):
            continue
        other = addresses.setdefault(one.identity.rstrip("/"), one.name)
        if other != one.name:
            yield problem(because("address_of_two", name=one.name, other=other), "robots", index, "address")
        for secret, path in robot_secrets(one):
            if not secret.has_one_place:
                yield problem(because("secret_needs_one_place"), "robots", index, *path)
        if one.evidence is not None:
            own = f"{one.name}/evidence"
            double = one.evidence.kind == "http" and addresses.setdefault(one.evidence.address.rstrip("/"), own) != own
            if double:
                yield problem(because("evidence_not_apart", name=one.name), "robots", index, "evidence", "address")
            for reason, key in _evidence_problems(one.name, one.evidence):
                yield problem(reason, "robots", index, "evidence", key)
        if one.authority == "observe" and isinstance(one, HttpRobotEntry) and one.teleoperation:
            yield problem(because("observed_and_teleoperated", name=one.name), "robots", index, "teleoperation")
        if one.footprint_m and len(one.footprint_m) < 3:
            yield problem(because("footprint_too_small", name=one.name), "robots", index, "footprint_m")


def _evidence_problems(name: str, evidence: EvidencePath) -> Iterator[tuple[Reason, str]]:
    """What a path for evidence of this kind lacks or has too much, and at which key."""
    scheme = urlsplit(evidence.address).scheme
    if scheme not in SCHEMES[evidence.kind]:
        schemes = tuple(f"{one}://" for one in SCHEMES[evidence.kind])
        yield because("evidence_address_of_other_kind", name=name, kind=evidence.kind, schemes=schemes), "address"
    if evidence.kind == "http":
        if evidence.token is None:
            yield because("evidence_token_missing", name=name), "address"
        if evidence.topics is not None or evidence.laser is not None:
            yield because("evidence_topics_unused", name=name), "topics" if evidence.topics else "laser"
    elif evidence.topics is None:
        yield because("evidence_topics_missing", name=name, kind=evidence.kind), "kind"
    if evidence.kind == "dds" and evidence.token is not None:
        yield because("evidence_token_unused"), "token"


def robot_notes(
    robots: RobotsFile, folder: Path, lines: Lines, *, has_secret: Callable[[SecretReference], bool]
) -> Iterator[ContractInvalid]:
    """A token that is not there yet: the robot cannot be connected, and everything else can be checked."""
    for index, one in enumerate(robots.robots):
        for secret, path in robot_secrets(one):
            if not has_secret(secret):
                yield ContractInvalid(
                    because("token_not_there", name=one.name, reference=secret.place),
                    where=at(folder / "robots.yaml", lines.of("robots", index, *path)),
                )


def robot_secrets(entry: RobotEntry) -> Iterator[tuple[SecretReference, tuple[Step, ...]]]:
    """The secrets that an entry names, with where they stand in it."""
    match entry:
        case HttpRobotEntry():
            yield entry.token, ("token",)
        case VehicleEntry():
            if entry.password is not None:
                yield entry.password, ("password",)
        case SimulatedRobotEntry():
            return
        case _:
            assert_never(entry)
    if entry.evidence is not None and entry.evidence.token is not None:
        yield entry.evidence.token, ("evidence", "token")


def channel_problems(channels: ChannelsFile, file: Path, lines: Lines) -> Iterator[HarnessError]:
    """Channels of one name, a default that is none, and secrets that stand nowhere or in two places."""

    def problem(reason: Reason, *path: Step) -> ContractInvalid:
        return ContractInvalid(reason, where=at(file, lines.of(*path)))

    names = [one.name for one in channels.channels]
    yield from _twice([("channels", names)], problem)
    if channels.default and channels.default not in names:
        yield problem(because("default_channel_unknown", name=channels.default, names=tuple(names)), "default")
    for index, one in enumerate(channels.channels):
        for field, reference in secrets_of(one).items():
            if not reference.has_one_place:
                yield problem(because("secret_needs_one_place"), "channels", index, field)
    endpoint = channels.voice.transcription
    token = endpoint.token if endpoint is not None else None
    if token is not None and not token.has_one_place:
        yield problem(because("secret_needs_one_place"), "voice", "transcription", "token")


def channel_notes(
    channels: ChannelsFile, file: Path, lines: Lines, *, has_secret: Callable[[SecretReference], bool]
) -> Iterator[ContractInvalid]:
    """Secrets that are not there yet, and channels of which a delivery can only be declared."""
    for index, one in enumerate(channels.channels):
        for field, reference in secrets_of(one).items():
            if reference.has_one_place and not has_secret(reference):
                missing = because("channel_secret_not_there", name=one.name, reference=reference.place)
                yield ContractInvalid(missing, where=at(file, lines.of("channels", index, field)))
        if not is_readable(one):
            where = at(file, lines.of("channels", index, "kind"))
            yield ContractInvalid(because("channel_declares_only", name=one.name), where=where)


def model_problems(models: ModelsFile, file: Path, lines: Lines) -> Iterator[HarnessError]:
    """Models of one name, roles of models that are not there, and models that cannot do what their role needs."""

    def problem(reason: Reason, *path: Step) -> ContractInvalid:
        return ContractInvalid(reason, where=at(file, lines.of(*path)))

    yield from _twice([("models", [one.name for one in models.models])], problem)
    for index, one in enumerate(models.models):
        if one.key is not None and not one.key.has_one_place:
            yield problem(because("secret_needs_one_place"), "models", index, "key")
    named = {one.name: one for one in models.models}
    for role, name in models.roles.items():
        if name not in named:
            yield problem(because("role_of_unknown_model", role=role, name=name, names=tuple(named)), "roles", role)
        elif role in SEEING_ROLES and not named[name].images:
            yield problem(because("role_needs_images", role=role, name=name), "roles", role)


def model_notes(
    models: ModelsFile, file: Path, lines: Lines, *, has_secret: Callable[[SecretReference], bool]
) -> Iterator[ContractInvalid]:
    """A key that is not there, or that would cross a network in clear; a model that has no role."""
    for index, one in enumerate(models.models):
        if one.name not in models.roles.values():
            yield ContractInvalid(
                because("model_without_role", name=one.name), where=at(file, lines.of("models", index, "name"))
            )
        if one.key is None:
            continue
        where = at(file, lines.of("models", index, "key"))
        if not has_secret(one.key):
            named = one.key.place
            yield ContractInvalid(because("model_key_not_there", name=one.name, reference=named), where=where)
        if one.base_url.startswith("http://") and urlsplit(one.base_url).hostname not in LOOPBACK:
            yield ContractInvalid(because("model_key_in_clear", name=one.name), where=where)


def capability_problems(
    types: Sequence[CapabilityType], file: Path, lines: Lines, *, predicates: ports.Predicates
) -> Iterator[HarnessError]:
    """Names of a site's own capabilities that are not `vendor.name` or stand twice, and effects that nobody tests."""

    def problem(reason: Reason, *path: Step) -> ContractInvalid:
        return ContractInvalid(reason, where=at(file, lines.of("capabilities", *path)))

    names = [one.name for one in types]
    for index, one in enumerate(types):
        if "." not in one.name:
            yield problem(because("capability_not_namespaced", capability=one.name), index, "name")
        if one.name in names[:index]:
            yield problem(because("name_stands_twice", name=one.name), index, "name")
        parameters = [parameter.name for parameter in one.parameters]
        for place, name in enumerate(parameters):
            if name in parameters[:place]:
                yield problem(because("name_stands_twice", name=name), index, "parameters", place, "name")
        own = {name for _, name in PREDICATES}
        for place, name in enumerate(one.effects):
            if name not in own and name not in predicates.installed:
                known = (*sorted(own), *predicates.installed)
                yield problem(
                    because("effect_without_predicate", capability=one.name, predicate=name, known=known),
                    index,
                    "effects",
                    place,
                )
        if one.estimates and one.effects:
            yield problem(because("estimates_claim_nothing", capability=one.name), index, "effects")


def mission_problems(
    template: TaskTemplate,
    site: Site,
    file: Path,
    lines: Lines,
    *,
    vocabulary: Vocabulary,
    predicates: ports.Predicates,
) -> Iterator[HarnessError]:
    """Why the mission could not be started as it stands, with its defaults, at this site."""
    undeclared = list(_undeclared(template, vocabulary))
    for index, place, name in undeclared:
        unknown = because("capability_undeclared", capability=name, known=vocabulary.names)
        yield ContractInvalid(unknown, where=at(file, lines.of("nodes", index, "capabilities", place)))
    if undeclared or any(parameter.default is None for parameter in template.parameters):
        return
    try:
        achieved = template.goal if tells_only(template) else ""
        contract = compile_contract(
            goal=template.goal, template=template, arguments={}, site=site, achieved=achieved, rules=CURRENT_RULES
        )
        if isinstance(template.outcome, str):
            outcome_in_words(template.outcome, contract)
        names = [node.node_id for node in contract.nodes]
        for one in problems(contract.nodes, vocabulary):
            where = lines.of("nodes", names.index(NodeId(one.node_id)), *one.path)
            yield ContractInvalid(one.reason, where=at(file, where))
        check_satisfiable(contract, site=site)
        with_pins(contract, predicates=predicates, vouched=site.vouched)
    except HarnessError as error:
        named = [
            index
            for index, parameter in enumerate(template.parameters)
            if parameter.name in str(error.where) or str(parameter.default) in str(error)
        ]
        path: tuple[Step, ...] = ("parameters", named[0], "default") if named else ("nodes",)
        yield relocated(error, file, lines.of(*path))


def _undeclared(template: TaskTemplate, vocabulary: Vocabulary) -> Iterator[tuple[int, int, str]]:
    """Capabilities of stages that nobody declares: stage, place in its list, name."""
    for index, node in enumerate(template.nodes):
        named = node.get("capabilities")
        for place, name in enumerate(named if isinstance(named, list) else ()):
            if vocabulary.of(str(name)) is None:
                yield index, place, str(name)


def speed_notes(
    missions: Sequence[tuple[TaskTemplate, Path, Lines]], robots: RobotsFile, folder: Path
) -> Iterator[ContractInvalid]:
    """Missions that ask for more speed than a robot of the site takes: its provider is refused for them."""
    limits = [(one.name, one.speed_limit_mps) for one in robots.robots if not isinstance(one, SimulatedRobotEntry)]
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
        half_m = 0.0 if isinstance(one, SimulatedRobotEntry) else _half_width_m(one.footprint_m)
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


def floor_at(floor: GridMap, point: Point) -> int | None:
    """What a floor map knows of a point; None outside of the map."""
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
