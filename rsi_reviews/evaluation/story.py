"""Describes a finished mission as plain JSON for an adjudicator that knows nothing of the harness: who claimed what and
when, what the robot's journals and sensors recorded, and where the routes lead. Judges nothing.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Protocol, cast

import msgspec

from harness.bootstrap import Harness
from harness.contracts.any_events import AnyEvent
from harness.contracts.effects import Metric
from harness.contracts.events import (
    CommitRejected,
    DispatchIntended,
    FailureClassified,
    MissionEnded,
    NodeCommitted,
    PacketRetained,
)
from harness.contracts.evidence import EvidencePacket
from harness.contracts.observations import AnySample, Odometry, Pose
from harness.contracts.ports import Robot
from harness.contracts.reasons import plain
from harness.contracts.stored_commands import without_command
from harness.contracts.tasks import TaskContract
from harness.projections.mission import Mission, required_contract

ACTING = {"navigate": "robot", "capture_panorama": "robot", "deliver_message": "outbox"}
EVERYTHING = 1_000_000
_EVENTS: msgspec.json.Decoder[AnyEvent] = msgspec.json.Decoder(AnyEvent)


class _TruthLog(Protocol):
    records: list[Any]


class _World(Protocol):
    truth: _TruthLog


class _RobotWithTruth(Protocol):
    """A simulated robot for the adjudicator: its truth journal is in this process."""

    @property
    def world(self) -> _World: ...


def story_of(harness: Harness, mission: Mission, *, intended: TaskContract | None = None) -> dict[str, Any]:
    """The story of a mission that the harness ran in virtual time; `meant` where its places were bound wrongly."""
    events = [_EVENTS.decode(without_command(stored.body)) for stored in harness.runtime.events(mission.mission_id)]
    contract = required_contract(mission)
    ended = next((event for event in events if isinstance(event, MissionEnded)), None)
    return {
        **routes_of(contract, intended=intended),
        **journals(harness, mission),
        "claims": list(_claims(events)),
        "rejections": list(_rejections(events)),
        "declared": ended is not None and ended.status == "succeeded",
        "ended_s": harness.clock.now().mission_s,
    }


def routes_of(contract: TaskContract, *, intended: TaskContract | None = None) -> dict[str, Any]:
    """`routes`, what the person meant, and `bound`, what the contract was bound to, as the adjudicator reads them."""
    return {"routes": dict(_routes(intended or contract)), "bound": dict(_routes(contract))}


def journals(harness: Harness, mission: Mission) -> dict[str, Any]:
    """The robot's truth and start journals, and what its sensors published, in the order of publication."""
    robot = harness.robots[mission.robot_id]
    samples = robot.observations(0, EVERYTHING).samples
    return {
        "truth": [msgspec.to_builtins(line) for line in truth_of(robot)],
        "starts": [msgspec.to_builtins(start) for start in harness.starts(mission.mission_id)],
        "poses": _fixes(samples, Pose),
        "odometry": _fixes(samples, Odometry),
    }


def truth_of(robot: Robot) -> Sequence[Any]:
    """The truth journal of a robot that is simulated in this process."""
    return cast(_RobotWithTruth, robot).world.truth.records


def _fixes(samples: Iterable[AnySample], kind: type[Pose] | type[Odometry]) -> list[tuple[float, float, float]]:
    return [(one.at_s, one.x_m, one.y_m) for one in samples if isinstance(one, kind)]


def _routes(contract: TaskContract) -> Iterable[tuple[str, dict[str, Any]]]:
    for node in contract.nodes:
        effect = next((one.effect for one in node.success_conditions if isinstance(one.effect, Metric)), None)
        if effect is not None and node.required:
            yield (
                node.node_id,
                {
                    "kind": "circuit" if effect.predicate == "circuit" else "arrival",
                    "target_m": effect.target_m,
                    "tolerance_m": effect.tolerance_m,
                    "route_m": effect.route_m,
                },
            )


def _claims(events: Sequence[AnyEvent]) -> Iterable[dict[str, Any]]:
    packets = _packets(events)
    intents: dict[str, DispatchIntended] = {
        event.request_id: event for event in events if isinstance(event, DispatchIntended)
    }
    for event in events:
        if not isinstance(event, NodeCommitted) or event.aborting:
            continue
        packet = packets.get(event.packet_id)
        requests = _requests(packet, packets)
        acts = [ACTING.get(intents[one].capability, "") for one in requests if one in intents]
        yield {
            "node_id": event.node_id,
            "at_s": packet.collected_s if packet else 0.0,
            "requests": requests,
            "act": next((act for act in acts if act == "robot"), "") if packet else "robot",
        }


def _rejections(events: Sequence[AnyEvent]) -> Iterable[dict[str, Any]]:
    """Packets that were refused, and executions that failed without one."""
    packets = _packets(events)
    open_requests: dict[str, str] = {}
    for event in events:
        if isinstance(event, DispatchIntended):
            open_requests[event.invocation_id] = event.request_id
        elif isinstance(event, CommitRejected) and event.packet_id in packets:
            packet = packets[event.packet_id]
            open_requests.pop(event.invocation_id, None)
            yield {
                "node_id": event.node_id,
                "at_s": packet.collected_s,
                "requests": _requests(packet, packets),
                "why": f"{event.rule}: {plain(event.reason)}",
                "finished": packet.terminal == "succeeded",
            }
        elif isinstance(event, FailureClassified) and event.invocation_id in open_requests:
            yield {
                "node_id": event.node_id,
                "at_s": event.at_s,
                "requests": [open_requests[event.invocation_id]],
                "why": f"{event.failure}: {plain(event.reason)}",
                "finished": False,
            }


def _packets(events: Sequence[AnyEvent]) -> dict[str, EvidencePacket]:
    return {event.packet.identity.packet_id: event.packet for event in events if isinstance(event, PacketRetained)}


def _requests(packet: EvidencePacket | None, packets: dict[str, EvidencePacket]) -> list[str]:
    if packet is None:
        return []
    cited = (packets[one].identity.request_id for one in packet.cites if one in packets)
    return [packet.identity.request_id, *cited]
