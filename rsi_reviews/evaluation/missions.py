"""Defines the missions of the protocol: two task contracts on fixed routes, and the fault condition of each cell."""

from typing import Any, Literal

import msgspec

from harness.baseline.load import baseline, site
from harness.contracts.configuration import Configuration
from harness.contracts.errors import UnknownName
from harness.contracts.ids import PlaceId
from harness.contracts.places import Place, Route, Site
from harness.contracts.reasons import because
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Name, Point, Value

CORNER = PlaceId("reading_corner")
CORNER_M: Point = (4.9, -2.513)
OUT_M: tuple[Point, ...] = ((0.0, 0.0), (0.5, -1.634), (1.3, -2.513), CORNER_M)
LOOK_ALIKE_M: dict[str, Point] = {"circuit": (0.2, 0.68), "patrol": (3.9, -2.513)}
"""What a registry that confuses two places binds `anchor_a` (circuit) and `reading_corner` (patrol) to."""
MissionName = Literal["circuit", "patrol"]
MISSIONS: tuple[MissionName, ...] = ("circuit", "patrol")


class FaultCondition(Value):
    """One fault condition. `faults`: the robot's own, by name. `aliased`: a place is bound to its look-alike.
    `misdelivers`: for four seconds of the first leg the wire delivers the last mission's final report instead.

    `protocol`: one of the five of the paper, or nominal. `unseen`: no gate can see it, since all sensors agree.
    """

    name: Name
    faults: tuple[str, ...]
    text: str
    aliased: bool = False
    misdelivers: bool = False
    protocol: bool = False
    unseen: bool = False


CONDITIONS: tuple[FaultCondition, ...] = (
    FaultCondition(name="nominal", faults=(), text="nothing is wrong", protocol=True),
    FaultCondition(name="pose-too-old", faults=("stale-pose",), text="poses keep an old stamp", protocol=True),
    FaultCondition(name="pose-absent", faults=("missing-pose",), text="no pose comes during the leg", protocol=True),
    FaultCondition(
        name="success-too-soon",
        faults=("early-success",),
        text="the provider declares success 2.5 m before the target, once",
        protocol=True,
    ),
    FaultCondition(
        name="request-twice",
        faults=("duplicate-request",),
        text="the acknowledgement is lost and the request comes again",
        protocol=True,
    ),
    FaultCondition(
        name="run-interrupted",
        faults=("interrupted",),
        text="the controller gives up in the middle of the leg, once",
        protocol=True,
    ),
    FaultCondition(
        name="success-too-soon-always",
        faults=("early-success:persistent",),
        text="the provider declares success 2.5 m before every target, always",
    ),
    FaultCondition(
        name="too-soon-and-unseen",
        faults=("early-success", "missing-pose"),
        text="success is declared too soon while no pose shows it, once",
    ),
    FaultCondition(
        name="interrupted-always",
        faults=("interrupted:persistent",),
        text="the controller gives up in the middle of every leg",
    ),
    FaultCondition(
        name="foreign-report",
        faults=(),
        text="the last mission's final report is delivered for the first leg, one to five seconds after its start",
        misdelivers=True,
    ),
    FaultCondition(
        name="biased-localiser",
        faults=("biased-localiser",),
        text="the localiser is 0.6 m off near the target, once; robot and harness use it",
        unseen=True,
    ),
    FaultCondition(
        name="place-aliasing",
        faults=(),
        text="the registry binds the place to its look-alike, 0.71 m (circuit) or 1.00 m (patrol) away",
        aliased=True,
        unseen=True,
    ),
)


def condition(name: str) -> FaultCondition:
    """The condition of that name; raises UnknownName."""
    found = next((one for one in CONDITIONS if one.name == name), None)
    if found is None:
        raise UnknownName(
            because("unknown_fault_condition", name=name, known=tuple(one.name for one in CONDITIONS)),
            where="--faults",
        )
    return found


def configuration() -> Configuration:
    """H_0 with the patrol beside its own templates."""
    first = baseline()
    return msgspec.structs.replace(first, templates=(*first.templates, _patrol(first)))


def surroundings(mission: MissionName, *, aliased: bool) -> Site:
    """The shipped site with the reading corner; `aliased`: the mission's place is bound to its look-alike."""
    shipped = site()
    corner = Place(
        place_id=CORNER,
        name="Reading corner",
        frame=shipped.frame,
        map_version=shipped.map_version,
        approach_m=CORNER_M,
        provenance="surveyed with the map",
        verification="configured",
    )
    ways = (("A-corner", "anchor_a", CORNER, OUT_M), ("corner-A", CORNER, "anchor_a", tuple(reversed(OUT_M))))
    routes = tuple(
        Route(
            name=name,
            frame=shipped.frame,
            map_version=shipped.map_version,
            start=PlaceId(start),
            end=PlaceId(end),
            waypoints_m=waypoints,
        )
        for name, start, end, waypoints in ways
    )
    whole = msgspec.structs.replace(shipped, places=(*shipped.places, corner), routes=(*shipped.routes, *routes))
    return _confused(whole, mission) if aliased else whole


def _confused(whole: Site, mission: MissionName) -> Site:
    """The look-alike replaces the place only where a route ends: the robot starts where it really stands."""
    place_id = PlaceId("anchor_a") if mission == "circuit" else CORNER
    twin = LOOK_ALIKE_M[mission]
    places = tuple(
        msgspec.structs.replace(place, approach_m=twin) if place.place_id == place_id else place
        for place in whole.places
    )
    routes = tuple(
        msgspec.structs.replace(route, waypoints_m=(*route.waypoints_m[:-1], twin)) if route.end == place_id else route
        for route in whole.routes
    )
    return msgspec.structs.replace(whole, places=places, routes=routes)


def _patrol(first: Configuration) -> TaskTemplate:
    """Out to the corner, back home, out again: the stages of the shipped inspection that only walk.

    It is started by its name and serves no clause of a goal: what the inspection declares of itself is not its own.
    """
    shipped = next(one for one in first.templates if one.name == "warehouse-inspection")
    by_name = {str(node["node_id"]): node for node in shipped.nodes}
    legs = (("out", "go", "request"), ("back", "return", "out"), ("again", "go", "back"))
    nodes = [_renamed(by_name[source], source, name, [after]) for name, source, after in legs]
    home = next(one for one in shipped.completion_conditions if one["condition_id"] == "goal.home")
    there = {
        **home,
        "condition_id": "goal.there",
        "text": "The body stands within 0.40 m of ${destination.name} now",
        "effect": {**home["effect"], "target_m": "${destination.approach_m}"},
    }
    ordered = next(one for one in shipped.completion_conditions if one["condition_id"] == "goal.in_order")
    names = ["request", *(name for name, _, _ in legs)]
    in_order = {**ordered, "text": "All stages were accepted in order", "effect": {**ordered["effect"], "nodes": names}}
    places = {"destination": CORNER, "home": PlaceId("anchor_a")}
    return msgspec.structs.replace(
        shipped,
        name="patrol",
        title="Patrol",
        goal="Walk to the reading corner, back, and there again",
        phrases=("patrol to the reading corner",),
        parameters=tuple(msgspec.structs.replace(one, default=places[one.name]) for one in shipped.parameters),
        nodes=(by_name["request"], *nodes),
        completion_conditions=(there, in_order),
        serves=msgspec.UNSET,
        stages=msgspec.UNSET,
    )


def _renamed(node: dict[str, Any], source: str, name: str, after: list[str]) -> dict[str, Any]:
    renamed = [
        {**one, "condition_id": str(one["condition_id"]).replace(f"{source}.", f"{name}.", 1)}
        for one in node["success_conditions"]
    ]
    return {**node, "node_id": name, "depends_on": after, "success_conditions": renamed, "runs_after_failure": False}
