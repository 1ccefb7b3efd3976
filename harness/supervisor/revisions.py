"""Carries out recovery steps that change what failed: new frames, from elsewhere if need be, or another route (D49).

Everything is planned on the map that the mission's own lidar sweeps draw; the gate decides on the revised contract.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from harness.contexts.view import forbidden_m
from harness.contracts.any_events import AnyEvent
from harness.contracts.contexts import Context
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.effects import Metric
from harness.contracts.exploration import GridMap
from harness.contracts.ids import Digest, MissionId, NodeId, PlaceId, ProviderId
from harness.contracts.memory import FloorBox, MemoryRecord
from harness.contracts.observations import Trajectory
from harness.contracts.places import Place
from harness.contracts.ports import Record
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.reasons import Reason, because
from harness.contracts.revision_commands import PassOverStep, RevisedPlan, ReviseToRecover
from harness.contracts.tasks import Node, TaskContract
from harness.contracts.values import Point, decode, digest
from harness.exploration.detours import detour
from harness.exploration.grid import merged, middle_of, unexplored, usable
from harness.exploration.paths import NARROWEST_CELLS, Cell, Ways
from harness.exploration.viewpoints import Viewpoint, viewpoints
from harness.memory.spatial import SIGHTING_HOLDS_S
from harness.planning import views
from harness.planning.waiting import waited_at
from harness.projections.mission import Failure, Mission, required_contract
from harness.projections.region import contains
from harness.recovery.state import OBSERVING
from harness.supervisor.roles import RoleContexts, context_record, record

PLANNER = "local-map-1"
APART_M = 0.8
"""Another viewpoint is at least so far from where frames were taken before."""
ASIDE_M = 1.5
"""A place nearer than this is no other place to wait at."""
BEFORE_LENS_M = 1.2
"""The floor nearer than this lies below the camera's picture."""
LEAST_SHARE = 0.3
ARRIVALS, MOST_REMEMBERED = 100, 12
"""So many accepted arrivals are looked through, and so many of earlier missions drawn."""
NOT_NOW = ("approval_required", "not_active", "in_flight")
"""Rules that refuse a revision for what stands around it, not for what it plans."""
ROUND = ("circuit",)
"""Predicates of legs whose route itself is to be driven, not only its end reached."""


@dataclass(frozen=True)
class Revision:
    """What a step changes: the revised contract, which stages begin again, why, and the map it was planned on."""

    contract: TaskContract
    reopened: tuple[NodeId, ...]
    reason: Reason
    records: tuple[Record, ...] = ()


@dataclass(frozen=True)
class DrawnMap:
    """The floor as it is known, and the ways over it from the body. `missions`: earlier ones that it rests on too."""

    grid: GridMap
    ways: Ways
    missions: tuple[MissionId, ...] = ()

    def with_target(self, reason: Reason) -> Reason:
        """The reason of a revision planned on it, with the missions whose sightings made it possible."""
        return because("planned_from_memory", plan=reason, missions=self.missions) if self.missions else reason


class Revisions:
    """Plans a revision for one recovery step, and has the gate decide on it."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles = roles
        self._runtime = roles.runtime

    def takes_frames_anew(self, mission: Mission, failure: Failure, proposal: RecoveryProposal) -> bool:
        """Whether the step looks again by taking frames anew, from where the body stands."""
        contract = required_contract(mission)
        reads = views.frames_of(contract, contract.node(failure.node_id))
        return proposal.action == "re_perceive" and reads is not None

    def plan(self, mission: Mission, node_id: NodeId, proposal: RecoveryProposal) -> RevisedPlan | None:
        """The plan that this step would go on with, for a person to approve; None where it changes no plan."""
        contract = required_contract(mission)
        planned = self._planned(mission, contract, contract.node(node_id), proposal)
        if not isinstance(planned, Revision):
            return None
        return RevisedPlan(
            node_id=node_id,
            contract=planned.contract,
            reopened=planned.reopened,
            planner=PLANNER,
            reason=planned.reason,
        )

    def waiting_places(self, mission: Mission) -> tuple[Place, ...]:
        """Places of the site that the robot could wait at: a known way leads there, and it does not stand there."""
        return tuple(place for place, _ in self._asides(mission))

    def waiting(self, mission: Mission, node_id: NodeId, place_id: PlaceId, wait_s: float) -> RevisedPlan | None:
        """The plan that goes to a place, waits there and then goes on with the stage; None where no way is known."""
        contract = required_contract(mission)
        node = contract.node(node_id)
        for place, way_m in self._asides(mission):
            if place.place_id == place_id:
                length_m = math.fsum(math.dist(a, b) for a, b in pairwise(way_m))
                return RevisedPlan(
                    node_id=node_id,
                    contract=waited_at(contract, node, place, route_m=way_m, wait_s=wait_s),
                    reopened=(),
                    planner=PLANNER,
                    reason=because("waits_aside", stage=node_id, place=place.name, wait_s=wait_s, length_m=length_m),
                )
        return None

    def _asides(self, mission: Mission) -> Iterator[tuple[Place, tuple[Point, ...]]]:
        """Places with the ways to them on this mission's own map, the nearest first."""
        contract, position = required_contract(mission), self._roles.position()
        drawn = next(self._maps(mission, position), None) if position is not None else None
        if position is None or drawn is None:
            return
        places = [
            one
            for one in self._runtime.site_of(mission).places
            if (one.frame, one.map_version) == (contract.frame, contract.map_version)
            and one.place_id not in contract.constraints.keep_out
            and math.dist(one.approach_m, position) > ASIDE_M
        ]
        for place in sorted(places, key=lambda one: math.dist(one.approach_m, position)):
            if way_m := drawn.ways.route_m(place.approach_m):
                yield place, way_m

    def carry_out(self, mission: Mission, failure: Failure, proposal: RecoveryProposal, c4: Context) -> bool | Refused:
        """Whether the step is done with: as a revision, or passed over where no other route is planned that the gate
        takes.

        False where the step is an invocation of its own. Refused where there is another route and it may not be taken
        now, as where somebody has to approve it: the same leg again would be no replanning.
        """
        contract = required_contract(mission)
        node = contract.node(failure.node_id)
        planned = self._planned(mission, contract, node, proposal)
        if planned is None:
            return False
        decision = self._submitted(mission, node, proposal, planned, c4)
        if not isinstance(decision, Refused):
            return True
        if proposal.action != "local_replan":
            return False
        if isinstance(planned, Revision) and decision.rule not in NOT_NOW:
            decision = self._submitted(mission, node, proposal, because("revision_refused", why=decision.reason), c4)
        return decision if isinstance(decision, Refused) else True

    def _submitted(
        self, mission: Mission, node: Node, proposal: RecoveryProposal, planned: Revision | Reason, c4: Context
    ) -> Accepted[AnyEvent] | Refused:
        """What the gate says to a revision, or to passing the step over for a reason."""
        contract = planned.contract if isinstance(planned, Revision) else required_contract(mission)
        signature = Signature(
            action=proposal.action,
            provider_id=proposal.provider_id or ProviderId(PLANNER),
            provider_version=PLANNER,
            parameters=digest(contract),
            failure=proposal.failure,
        )
        command = self._command(node, proposal, planned, signature=signature, c4=c4)
        records = (context_record(c4), *(planned.records if isinstance(planned, Revision) else ()))
        return self._runtime.submit(mission.mission_id, command, records=records)

    def _command(
        self, node: Node, proposal: RecoveryProposal, planned: Revision | Reason, *, signature: Signature, c4: Context
    ) -> ReviseToRecover | PassOverStep:
        if isinstance(planned, Reason):
            return PassOverStep(
                node_id=node.node_id,
                proposal=proposal,
                signature=signature,
                context=c4.digest,
                reason=because("step_not_applicable", action=proposal.action, why=planned),
                at_s=self._roles.connection.clock.now().mission_s,
            )
        return ReviseToRecover(
            node_id=node.node_id,
            contract=planned.contract,
            reopened=planned.reopened,
            proposal=proposal,
            signature=signature,
            context=c4.digest,
            planner=PLANNER,
            reason=planned.reason,
        )

    def _planned(
        self, mission: Mission, contract: TaskContract, node: Node, proposal: RecoveryProposal
    ) -> Revision | Reason | None:
        """What the step changes; why it can change nothing; None where it is an invocation of its own."""
        source = views.frames_of(contract, node)
        if proposal.action in OBSERVING and source is not None:
            again = views.seen_anew(contract, node, source)
            if proposal.action == "re_perceive":
                return Revision(contract, again, because("frames_taken_anew", stage=source.node_id))
            return self._elsewhere(mission, contract, node, source, again)
        if proposal.action == "local_replan":
            return self._around(mission, contract, node)
        return None

    def _elsewhere(
        self, mission: Mission, contract: TaskContract, node: Node, source: Node, again: tuple[NodeId, ...]
    ) -> Revision | None:
        """Frames from the place that shows most of the region and was not tried."""
        region, position = views.region_of(node), self._roles.position()
        if not region or position is None:
            return None
        for drawn in self._maps(mission, position):
            seen = viewpoints(
                drawn.grid,
                drawn.ways,
                _cells(drawn.grid, region),
                nearest_m=BEFORE_LENS_M,
                away_from=_taken_at(mission, source.node_id),
                apart_m=APART_M,
            )
            best = max(seen, key=_worth, default=None)
            if best is None or best.share < LEAST_SHARE:
                continue
            revised = views.seen_from(contract, source, best.at_m, route_m=drawn.ways.route_m(best.at_m))
            reason = because(
                "seen_from_elsewhere",
                stage=source.node_id,
                x_m=best.at_m[0],
                y_m=best.at_m[1],
                percent=100.0 * best.share,
                way_m=best.way_m,
            )
            return Revision(revised, again, drawn.with_target(reason), (record("local-map", drawn.grid),))
        return None

    def _around(self, mission: Mission, contract: TaskContract, node: Node) -> Revision | Reason:
        """Another route around what the lidar showed on the old one, or why there is none."""
        position, route = self._roles.position(), _points(node.parameters.get("route"))
        if "navigate" not in node.capabilities or len(route) < 2:
            return because("drives_no_route", stage=node.node_id)
        if position is None:
            return because("not_localised_now")
        effects = [one.effect for one in node.success_conditions]
        beside = any(isinstance(one, Metric) and one.predicate in ROUND for one in effects)
        for drawn in self._maps(mission, position, clearance_cells=NARROWEST_CELLS):
            found = detour(drawn.grid, drawn.ways, route, position, beside=beside)
            if not found:
                continue
            length_m = math.fsum(math.dist(a, b) for a, b in pairwise(found))
            reason = because("route_revised", stage=node.node_id, corners=len(found), length_m=length_m)
            records = (record("local-map", drawn.grid),)
            return Revision(views.rerouted(contract, node, found), (), drawn.with_target(reason), records)
        return because("no_detour", stage=node.node_id)

    def _maps(self, mission: Mission, position: Point, *, clearance_cells: float | None = None) -> Iterator[DrawnMap]:
        """The floor as this mission's sweeps show it, with the ways over it from the body; then, where spatial memory
        holds more of it, the same drawn over what earlier missions saw. None of a site without zones: nothing says how
        far its floor reaches.
        """
        contract, site = required_contract(mission), self._runtime.site_of(mission)
        if not site.zones:
            return
        nothing = unexplored(site, map_version=contract.map_version)
        keep_out = tuple(forbidden_m(site, contract.constraints.keep_out).values())
        stored = self._runtime.has_blob
        sweeps = usable(nothing, self._trajectories(_estimates(mission)), stored=stored)
        own = merged(nothing, sweeps, self._runtime.blob)
        yield DrawnMap(own, Ways(own, position, keep_out_m=keep_out, clearance_cells=clearance_cells))
        earlier = self._memories(mission, nothing)
        remembered = self._trajectories(blob for one in earlier for blob in one.provenance.blobs)
        seen = usable(nothing, remembered, stored=stored)
        if not seen:
            return
        whole = merged(merged(nothing, seen, self._runtime.blob), sweeps, self._runtime.blob)
        missions = tuple(dict.fromkeys(one.provenance.mission_id for one in earlier))
        yield DrawnMap(whole, Ways(whole, position, keep_out_m=keep_out, clearance_cells=clearance_cells), missions)

    def _memories(self, mission: Mission, grid: GridMap) -> tuple[MemoryRecord, ...]:
        """What spatial memory holds of this floor: accepted arrivals of other missions within a shift."""
        (low_x, low_y), size = grid.origin_m, grid.cell_m
        floor = FloorBox(
            frame=grid.frame,
            map_version=grid.map_version,
            x_min_m=low_x,
            y_min_m=low_y,
            x_max_m=low_x + size * grid.columns,
            y_max_m=low_y + size * grid.rows,
        )
        since_s = self._roles.connection.clock.now().mission_s - SIGHTING_HOLDS_S
        known = self._runtime.memory.arrivals(floor, since_s=since_s, limit=ARRIVALS)
        others = (one for one in known if one.provenance.mission_id != mission.mission_id)
        return tuple(islice(others, MOST_REMEMBERED))[::-1]

    def _trajectories(self, blobs: Iterable[Digest]) -> list[Trajectory]:
        """What was recorded on the way, as far as it is still kept."""
        stored = (blob for blob in blobs if self._runtime.has_blob(blob))
        return [decode(self._runtime.blob(blob), Trajectory) for blob in stored]


def _estimates(mission: Mission) -> Iterator[Digest]:
    """What was recorded in every execution of this mission, in their order."""
    states = (*mission.nodes.values(), *(past.state for past in mission.history))
    packets = {packet.identity.packet_id: packet for state in states for packet in state.packets}
    for packet in sorted(packets.values(), key=lambda packet: (packet.dispatched_s, packet.identity.packet_id)):
        yield from (one.blob for one in packet.estimates)


def _worth(viewpoint: Viewpoint) -> tuple[float, float]:
    """What is seen counts first, in tenths; then the shorter way."""
    return round(viewpoint.share, 1), -viewpoint.way_m


def _cells(grid: GridMap, region: tuple[Point, ...]) -> tuple[Cell, ...]:
    inside = np.ndindex(grid.rows, grid.columns)
    return tuple((row, column) for row, column in inside if contains(region, middle_of(grid, (row, column))))


def _taken_at(mission: Mission, source: NodeId) -> tuple[Point, ...]:
    """Where the stage has taken frames, superseded ones included."""
    facts = (*mission.facts, *(fact for past in mission.history for fact in past.facts))
    places = (fact.arguments.get("position") for fact in facts if fact.node_id == source)
    return tuple(point for place in places for point in _points([place]))


def _points(value: object) -> tuple[Point, ...]:
    """Points of the floor, as parameters and facts hold them."""
    listed = value if isinstance(value, tuple | list) else ()
    return tuple((float(one[0]), float(one[1])) for one in listed if isinstance(one, tuple | list) and len(one) == 2)
