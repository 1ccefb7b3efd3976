"""Derives an exploring mission's targets and maps again from what was stored with its choices (R224)."""

from collections.abc import Callable
from typing import Any

from harness.auditing.prose import same
from harness.contracts import exploration
from harness.contracts.evidence import EvidencePacket
from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.observations import Trajectory
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.tasks import TaskContract
from harness.contracts.values import decode, encode
from harness.exploration.frontiers import edges
from harness.exploration.grid import merged, usable
from harness.exploration.paths import Ways
from harness.exploration.targets import NEAREST_EDGE, given_up, nearest_edge, target_choice
from harness.projections.exploration import choices, feedback, newest_image, unmapped, updates
from harness.projections.floor import cells_of
from harness.projections.mission import Mission, required_contract
from harness.runtime import Runtime

Stored = Callable[[Digest, type[Any]], Any]


def new_choices(mission: Mission, proposed: TaskContract) -> dict[NodeId, exploration.TargetChoice]:
    """The targets that a revision brings."""
    known = choices(required_contract(mission))
    return {leg: choice for leg, choice in choices(proposed).items() if leg not in known}


def target_differences(
    runtime: Runtime, mission: Mission, choice: exploration.TargetChoice, *, stored: Stored
) -> list[Reason]:
    """How a choice differs from what its question leads to now; derived on the mission as it was before it."""
    question: exploration.TargetQuestion = stored(choice.question, exploration.TargetQuestion)
    answer: exploration.TargetAnswer = stored(choice.answer, exploration.TargetAnswer)
    grid = decode(runtime.blob(question.map), exploration.GridMap)
    ways = Ways(grid, question.position_m, keep_out_m=question.keep_out_m)
    found_edges = edges(grid, ways, zones_m=question.zones_m, given_up=given_up(question.feedback))
    if question.frontiers == edges(grid, ways):
        found_edges = question.frontiers  # as explorations of older releases listed them
    known = updates(mission)
    inputs = {
        "mission": (question.mission_id, mission.mission_id),
        "configuration": (question.configuration, mission.configuration),
        "state version": (question.k, mission.k),
        "picture": (question.image, newest_image(mission)),
        "map": (question.map, known[-1][1].after if known else None),
        "feedback": (question.feedback, feedback(mission)),
        "edges": (question.frontiers, found_edges),
    }
    other = tuple(name for name, (original, again) in inputs.items() if original != again)
    found = [because("audited_target_of_other_inputs", inputs=other)] if other else []
    original = nearest_edge(question) if answer.planner == NEAREST_EDGE.name else answer.said
    silent: Explanation = answer.refused if answer.said is None else ""
    again = target_choice(answer.planner, original, refused=silent, question=question, grid=grid)
    if not same(again, answer, old=True):
        found.append(because("audited_target_differs", stored=_place(answer), derived=_place(again)))
    admitted = (answer.chosen.target_m, answer.chosen.reason) if answer.chosen else None
    made = (admitted, answer.refused, answer.planner, question.image, question.map)
    if not same(
        ((choice.target_m, choice.reason), choice.refused, choice.planner, choice.image, choice.map), made, old=True
    ):
        found.append(because("audited_choice_not_bound"))
    return found


def map_differences(runtime: Runtime, mission: Mission, update: exploration.MapUpdate) -> list[Reason]:
    """How a map differs from what its packets' sweeps produce on the map before it."""
    known = updates(mission)
    packets = unmapped(mission)
    before = decode(runtime.blob(update.before), exploration.GridMap)
    found = []
    if known and known[-1][1].after != update.before:
        found.append(because("audited_map_of_other_basis"))
    if not known and (cells_of(before) != exploration.UNKNOWN).any():
        found.append(because("audited_first_map_not_empty"))
    if tuple(packet.identity.packet_id for packet in packets) != update.packets:
        found.append(because("audited_map_of_other_packets"))
    drawn = frozenset(update.sweeps)
    sweeps = usable(
        before, _trajectories(runtime, packets), stored=lambda digest: digest in drawn or runtime.has_blob(digest)
    )
    if tuple(scan.blob for _, scan in sweeps) != update.sweeps:
        found.append(because("audited_map_of_other_sweeps"))
    again = sha256(encode(merged(before, sweeps, runtime.blob)))
    if again != update.after:
        found.append(because("audited_map_differs", stored=update.after[:12], derived=again[:12]))
    return found


def _trajectories(runtime: Runtime, packets: tuple[EvidencePacket, ...]) -> list[Trajectory]:
    return [decode(runtime.blob(one.blob), Trajectory) for packet in packets for one in packet.estimates]


def _place(answer: exploration.TargetAnswer) -> str:
    return f"({answer.chosen.target_m[0]:.2f}, {answer.chosen.target_m[1]:.2f})" if answer.chosen else "none"
