"""One mission as a JSON object, the same from the command line and from the API."""

from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from math import dist
from typing import Any

import msgspec

from app.i18n.reasons import rendering as reasons
from app.views.communication import communication_json
from app.views.proposals import proposals_json
from app.views.proposers import proposers_json
from app.views.readings import clauses_json, mission_reading, reading_json
from app.views.timeline import TimelineEntry
from harness.contracts.effects import Metric
from harness.contracts.events import DispatchIntended, PacketRetained
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.handoff_events import HandoffOpened, NoAnswerTaken
from harness.contracts.protocol import PhysicalStart, Receipt
from harness.contracts.retreat_events import RetreatEnded, RetreatEvent, RetreatIntended
from harness.contracts.spoken_goals import SpokenGoal
from harness.contracts.tasks import Node, order
from harness.projections.mission import Mission, NodeState, declared_goals
from harness.projections.starts import repeated_starts
from harness.projections.unverified import unverified_parts


def mission_outcome(
    mission: Mission, entries: Sequence[TimelineEntry], starts: Sequence[PhysicalStart] | None
) -> dict[str, Any]:
    """What became of a mission. `starts` is the robot's journal; None where it cannot be read: counts are null then."""
    packets = [entry.event.packet for entry in entries if isinstance(entry.event, PacketRetained)]
    contract = mission.contract
    total = contract.recovery_total if contract else 0
    mine = [start for start in starts if start.mission_id == mission.mission_id] if starts is not None else None
    return {
        "mission_id": mission.mission_id,
        "status": mission.status,
        "disputed": sorted({one.condition_id for one in mission.disputed}),
        "goal": mission.goal,
        "spoken": msgspec.to_builtins(mission.spoken) if isinstance(mission.spoken, SpokenGoal) else None,
        "reading": reading_json(mission.goal, reading) if (reading := mission_reading(mission)) else None,
        "clauses": clauses_json(mission),
        "template": mission.template,
        "robot_id": mission.robot_id,
        "goal_verdict": mission.goal_outcome or None,
        "goal_conditions": goal_conditions(mission),
        "declared_conditions": declared_conditions(mission),
        "unverified_parts": msgspec.to_builtins(unverified_parts(mission)),
        **reasons.stated("reason", mission.reason),
        **reasons.stated("report", mission.report),
        "state_version": mission.k,
        "configuration": mission.configuration,
        "seed": mission.seed,
        "labels": mission.labels,
        "handoff_id": mission.handoff_id,
        "stages": _stages(mission),
        "segments": _segments(mission),
        "images": _images(packets),
        "findings": _findings(packets),
        "receipts": [_receipt(receipt, packet) for packet in packets for receipt in packet.receipts],
        **communication_json(mission),
        "proposals": proposals_json(entries, contract),
        "proposed_by": proposers_json(entries),
        "recovery": {"spent": mission.spent_total, "remaining": max(total - mission.spent_total, 0)},
        "dispatches": sum(isinstance(entry.event, DispatchIntended) for entry in entries),
        "physical_starts": len(mine) if mine is not None else None,
        "duplicate_starts": repeated_starts(mine) if mine is not None else None,
        "events": len(entries),
    }


def goal_conditions(mission: Mission) -> list[dict[str, Any]]:
    """The completion conditions as they were tested last; one that rests on a declared stage has the verdict
    "declared".
    """
    if mission.goal_verdict is None:
        return []
    declared = {condition.condition_id for condition in declared_goals(mission)}
    return [
        {
            "condition_id": one.condition_id,
            "text": one.text,
            "verdict": "declared" if one.condition_id in declared and one.verdict == "ambiguous" else one.verdict,
            "independence": one.independence,
            "required_independence": one.required_independence,
            "sources": list(one.sources),
            "rests_on": list(one.rests_on or ()),
        }
        for one in mission.goal_verdict.results
    ]


def declared_conditions(mission: Mission) -> list[dict[str, Any]]:
    """What only a provider declares, and the completion conditions that rest on it; `node_id` is null for those."""
    effects = [
        {"condition_id": effect.condition_id, "node_id": effect.node_id, "text": effect.text}
        for effect in mission.declared
    ]
    goals = [
        {"condition_id": condition.condition_id, "node_id": None, "text": condition.text}
        for condition in declared_goals(mission)
    ]
    return [*effects, *goals]


def no_answer_outcome(
    opened: HandoffOpened, taken: NoAnswerTaken | None, retreat: Sequence[RetreatEvent]
) -> dict[str, Any]:
    """What was to happen where nobody answered this question, what was done, and what of it was measured (D27).

    `taken` is None while it goes on; `retreat` are the events of the one that was sent for it, none if none was.
    Metres and radians; nothing of it is accepted.
    """
    return {
        "handoff_id": opened.handoff_id,
        "intended": {
            "action": opened.no_answer,
            "safe_place": opened.safe_place or None,
            "otherwise": opened.otherwise or None,
        },
        "done": {"action": taken.action, "shown": taken.done, **reasons.stated("reason", taken.reason)}
        if taken
        else None,
        "measured": taken.measured if taken else None,
        "retreat": _retreat(retreat),
    }


def _retreat(events: Sequence[RetreatEvent]) -> dict[str, Any] | None:
    intent = next((one for one in events if isinstance(one, RetreatIntended)), None)
    ended = next((one for one in events if isinstance(one, RetreatEnded)), None)
    if intent is None:
        return None
    return {
        "place": intent.place,
        "target_m": list(intent.target_m),
        "frame": intent.frame,
        "map_version": intent.map_version,
        "authorised_by": intent.authorised_by,
        "authorised_on": intent.authorised_on,
        "request_id": intent.request_id,
        "declared": ended.declared if ended else None,
        "measured": ended.measured if ended else None,
        "outcome": ended.outcome if ended else None,
    }


def _stages(mission: Mission) -> list[dict[str, Any]]:
    if mission.contract is None:
        return []
    return [
        {
            "node_id": node_id,
            "status": mission.of(node_id).status,
            "attempt": mission.of(node_id).attempt,
            "provider_id": mission.of(node_id).provider_id,
            "verdict": mission.of(node_id).verdicts[-1].verdict if mission.of(node_id).verdicts else None,
            "accepted_at_k": mission.of(node_id).committed_k,
            "declared_at_k": mission.of(node_id).declared_k,
        }
        for node_id in order(mission.contract)
    ]


def _segments(mission: Mission) -> list[dict[str, Any]]:
    """One per navigating stage: reference length, what the provider declared on arrival, what the harness measured."""
    if mission.contract is None:
        return []
    found = []
    for node_id in order(mission.contract):
        node, state = mission.contract.node(node_id), mission.of(node_id)
        if "navigate" in node.capabilities:
            found.append(_segment(node, state))
    return found


def _segment(node: Node, state: NodeState) -> dict[str, Any]:
    declared = next((p.declared["distance_m"] for p in reversed(state.packets) if "distance_m" in p.declared), None)
    return {
        "name": node.node_id,
        "reference_length_m": _reference_length(node),
        "declared_distance_m": declared,
        "measured_distance_m": _newest(state, "distance_m"),
        "last_pose_distance_m": _newest(state, "last_pose_distance_m"),
        "path_length_m": _newest(state, "path_length_m"),
    }


def _reference_length(node: Node) -> float | None:
    """L_ref: planar distances between the commanded waypoints, summed, metres (R209)."""
    effects = [one.effect for one in node.success_conditions if isinstance(one.effect, Metric)]
    route: Sequence[Any] = next((effect.route_m for effect in effects if effect.route_m), ())
    if not route:
        commanded = node.parameters.get("route", ())
        route = commanded if isinstance(commanded, tuple) else ()
    points = [tuple(point) for point in route if not isinstance(point, float | str)]
    return sum(dist(a, b) for a, b in pairwise(points)) if len(points) > 1 else None


def _newest(state: NodeState, name: str) -> float | None:
    results = [result for verdict in reversed(state.verdicts) for result in verdict.results]
    return next((result.measured[name] for result in results if name in result.measured), None)


def _images(packets: Sequence[EvidencePacket]) -> list[dict[str, Any]]:
    frames: dict[str, EvidenceReference] = {}
    for packet in packets:
        for reference in (*packet.before, *packet.after):
            if reference.kind == "image":
                frames.setdefault(reference.blob, reference)
    return [
        {
            "sha256": frame.blob,
            "width": int(frame.values.get("width_px", 0)),
            "height": int(frame.values.get("height_px", 0)),
            "captured_at": datetime.fromtimestamp(frame.from_s, UTC).isoformat(timespec="milliseconds"),
        }
        for frame in sorted(frames.values(), key=lambda one: one.from_s)
    ]


def _findings(packets: Sequence[EvidencePacket]) -> list[dict[str, Any]]:
    """What the analysis said, newest last: the service's word, with the digest of its report."""
    return [
        {
            "text": receipt.text,
            "source": receipt.source,
            "report_sha256": receipt.blob,
            "values": receipt.values,
        }
        for packet in packets
        for receipt in packet.receipts
        if receipt.kind == "analysis"
    ]


def _receipt(receipt: Receipt, packet: EvidencePacket) -> dict[str, Any]:
    return {
        "receipt_id": receipt.receipt_id,
        "kind": receipt.kind,
        "node_id": packet.identity.node_id,
        "source": receipt.source,
        "at": datetime.fromtimestamp(receipt.at_s, UTC).isoformat(timespec="milliseconds"),
        "text": receipt.text,
        "sha256": receipt.blob,
        "values": receipt.values,
    }
