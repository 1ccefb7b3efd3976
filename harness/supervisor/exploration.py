"""Explores: draws observations into the map, has the next target proposed, and asks the gate for the stages to it.

It starts nothing itself: an admitted target becomes a revision of the contract, and the agent loop dispatches its leg
like any other stage. When nothing is left to choose, the stage that waited for it continues.
"""

from msgspec import convert

from harness.contexts.view import forbidden_m
from harness.contracts import exploration
from harness.contracts.commands import RecordObservation
from harness.contracts.decisions import Accepted
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, NodeId
from harness.contracts.observations import Trajectory
from harness.contracts.revision_commands import ReviseContract
from harness.contracts.tasks import Node
from harness.contracts.values import Point, decode, encode
from harness.exploration.frontiers import edges
from harness.exploration.grid import area_m2, changed_m2, merged, unexplored, usable
from harness.exploration.paths import Ways
from harness.exploration.targets import NEAREST_EDGE, answered, given_up
from harness.planning.targets import COVERAGE, EXPLORES, REGION, exploring, extended
from harness.projections.exploration import MAP, choices, feedback, newest_image, unmapped, updates, views
from harness.projections.floor import coverage
from harness.projections.mission import Mission, eligible, required_contract
from harness.recovery.state import left_now, left_of
from harness.supervisor.roles import RoleContexts, record

LONGEST_WAY_M = 30.0
FRUITLESS, LEAST_NEW_M2 = 3, 0.4
"""After so many of its own targets in a row that opened less floor than this, more of them would not show more."""
IDLE = 2
"""After so many targets of another proposer in a row that opened no floor, the harness chooses by itself."""


class Explorer:
    """Chooses the next target of an exploring mission, one at a time."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection

    def due(self, mission: Mission) -> bool:
        """Whether only the stage that closes the exploration is left to start."""
        closing = exploring(required_contract(mission))
        return (
            closing is not None and eligible(mission) == (closing.node_id,) and not mission.of(closing.node_id).failures
        )

    def choose(self, mission: Mission) -> bool:
        """Bring the map up to date, then add the stages of one more target. False: nothing is to be added."""
        if fresh := unmapped(mission):
            self._draw(mission, fresh)
            mission = self._runtime.mission(mission.mission_id)
        closing = exploring(required_contract(mission))
        position = self._roles.position()
        image = newest_image(mission)
        known = updates(mission)
        if closing is None or position is None or image is None or not known:
            return False
        grid = decode(self._runtime.blob(known[-1][1].after), exploration.GridMap)
        if _enough(mission, closing, grid):
            return False
        question = self._question(mission, closing, grid=grid, position=position, image=image)
        if not question.left:
            return False
        proposer = NEAREST_EDGE if _idle(mission) else self._connection.proposer
        answer = answered(proposer, question=question, grid=grid, picture=self._runtime.blob(image))
        return answer.chosen is not None and self._revise(mission, closing, question, answer)

    def _draw(self, mission: Mission, packets: tuple[EvidencePacket, ...]) -> None:
        """One map update: what the lidar of these executions saw, in order."""
        known = updates(mission)
        before = known[-1][1].after if known else self._runtime.keep(encode(self._unexplored(mission)))
        grid = decode(self._runtime.blob(before), exploration.GridMap)
        trajectories = [
            decode(self._runtime.blob(one.blob), Trajectory) for packet in packets for one in packet.estimates
        ]
        sweeps = usable(grid, trajectories, stored=self._runtime.has_blob)
        after = merged(grid, sweeps, self._runtime.blob)
        update = RecordObservation(
            node_id=_followed(packets),
            reference=EvidenceReference(
                kind=MAP,
                origin="sensor",
                source="lidar",
                from_s=min(packet.dispatched_s for packet in packets),
                until_s=max(packet.terminal_s for packet in packets),
                confidence=1.0,
                blob=self._runtime.keep(encode(after)),
                frame=grid.frame,
                map_version=grid.map_version,
                values={
                    "after_stage": _followed(packets),
                    "before": before,
                    "packets": " ".join(packet.identity.packet_id for packet in packets),
                    "sweeps": " ".join(scan.blob for _, scan in sweeps),
                    "known_m2": area_m2(after, kind=exploration.FREE) + area_m2(after, kind=exploration.OCCUPIED),
                    "opened_m2": changed_m2(grid, after, to=exploration.FREE),
                    "closed_m2": changed_m2(grid, after, to=exploration.OCCUPIED),
                },
            ),
        )
        self._runtime.submit(mission.mission_id, update)

    def _unexplored(self, mission: Mission) -> exploration.GridMap:
        contract = required_contract(mission)
        closing = exploring(contract)
        region_m = _region(closing) if closing else ()
        return unexplored(self._runtime.site_of(mission), map_version=contract.map_version, region_m=region_m)

    def _question(
        self, mission: Mission, closing: Node, *, grid: exploration.GridMap, position: Point, image: Digest
    ) -> exploration.TargetQuestion:
        contract, site = required_contract(mission), self._runtime.site_of(mission)
        state = mission.of(closing.node_id)
        keep_out = tuple(forbidden_m(site, contract.constraints.keep_out).values())
        region_m = _region(closing)
        zones = (region_m,) if region_m else tuple(zone.region_m for zone in site.zones)
        given_feedback = feedback(mission)
        left = min(*left_now(mission, closing.node_id), left_of(closing.recovery, state.spends)["local_replan"])
        return exploration.TargetQuestion(
            mission_id=mission.mission_id,
            configuration=mission.configuration,
            k=mission.k,
            at_s=self._connection.clock.now().mission_s,
            objective=contract.goal.text[:200],
            frame=contract.frame,
            map_version=contract.map_version,
            position_m=position,
            image=image,
            map=updates(mission)[-1][1].after,
            frontiers=edges(
                grid, Ways(grid, position, keep_out_m=keep_out), zones_m=zones, given_up=given_up(given_feedback)
            ),
            feedback=given_feedback,
            left=left,
            longest_way_m=LONGEST_WAY_M,
            zones_m=zones,
            keep_out_m=keep_out,
        )

    def _revise(
        self, mission: Mission, closing: Node, question: exploration.TargetQuestion, answer: exploration.TargetAnswer
    ) -> bool:
        """The gate decides on the contract with this target; the records of the choice are stored with it."""
        if answer.chosen is None:
            return False
        question_record, answer_record = record("target-question", question), record("target-answer", answer)
        choice = exploration.TargetChoice(
            mission_id=mission.mission_id,
            configuration=mission.configuration,
            k=mission.k,
            target_m=answer.chosen.target_m,
            reason=answer.chosen.reason,
            planner=answer.planner,
            refused=answer.refused,
            image=question.image,
            map=question.map,
            question=question_record.digest,
            answer=answer_record.digest,
        )
        contract = extended(required_contract(mission), choice, route_m=answer.route_m)
        command = ReviseContract(
            node_id=closing.node_id, contract=contract, planner=answer.planner, reason=answer.chosen.reason
        )
        return isinstance(
            self._runtime.submit(mission.mission_id, command, records=(question_record, answer_record)), Accepted
        )


def _region(closing: Node) -> exploration.Region:
    """The floor that is to be explored; empty where it is all of the site's zones."""
    stated = closing.parameters.get(REGION, ())
    return convert(stated, exploration.Region) if stated else ()


def _enough(mission: Mission, closing: Node, grid: exploration.GridMap) -> bool:
    """Whether the share of the floor is seen, or the views are accepted, that the contract wants.

    The last view is still to be taken then.
    """
    share, count = closing.parameters.get(COVERAGE), closing.parameters.get(EXPLORES)
    if isinstance(share, int | float) and not isinstance(share, bool):
        return coverage(grid).share >= share or _nothing_new(mission)
    return isinstance(count, int | float) and not isinstance(count, bool) and len(views(mission)) >= count


def _nothing_new(mission: Mission) -> bool:
    """Whether the last targets that the harness chose by itself, one after the other, opened no floor worth a way."""
    last = _fruitless(mission, own=True)[-FRUITLESS:]
    return len(last) == FRUITLESS and all(last)


def _idle(mission: Mission) -> bool:
    """Whether targets that another proposer chose opened no floor worth a way, IDLE of them in a row."""
    fruitless = _fruitless(mission, own=False)
    return any(all(fruitless[at : at + IDLE]) for at in range(len(fruitless) - IDLE + 1))


def _fruitless(mission: Mission, *, own: bool) -> list[bool]:
    """Of each target that the harness chose by itself, or that another proposer chose: whether it opened no floor."""
    chosen = choices(required_contract(mission))
    return [
        change.opened_m2 < LEAST_NEW_M2
        for leg, change in updates(mission)
        if leg in chosen and own == (chosen[leg].planner == NEAREST_EDGE.name or bool(chosen[leg].refused))
    ]


def _followed(packets: tuple[EvidencePacket, ...]) -> NodeId:
    """The stage whose execution the map update follows: the first of them, for a look only adds to its leg."""
    return packets[0].identity.node_id
