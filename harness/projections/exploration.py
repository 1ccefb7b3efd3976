"""Reads an exploring mission's choices, their results and the maps between them from its folded state. Pure.

Nothing here is a provider's text: feedback is typed, and taken from verdicts, failures and maps (R223, R224).
"""

from collections.abc import Iterator, Sequence

import msgspec

from harness.contracts import exploration, ids
from harness.contracts.errors import ContractInvalid
from harness.contracts.evidence import CommittedFact, EvidencePacket, EvidenceReference
from harness.contracts.protocol import InvocationStatus
from harness.contracts.reasons import Explanation, because
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Count, Name, Point, Value
from harness.contracts.verdicts import Verdict
from harness.projections.mission import Mission, NodeState, NodeStatus, required_contract

MAP = "map"
TARGETS = "targets"
"""Choices are in a contract's bindings under this name, by the leg that goes there."""


class PlannerResponse(Value):
    """The local planner's result for a target and the gate's decision on it: the newest execution towards the
    target."""

    provider_id: ids.ProviderId
    packet_id: ids.PacketId
    terminal: InvocationStatus
    failure: str
    verdict: Verdict | None


class ExplorationDecision(Value):
    """One choice with everything that belongs to it, under one mission (R224).

    `image` and `map_before` are what it was made from, `map_after` the map that resulted on the way; `response` is None
    until the leg was executed. `question` and `answer` are the records of the choice.
    """

    mission_id: ids.MissionId
    configuration: ids.Digest
    k: Count
    leg: ids.NodeId
    image: ids.Digest
    target_m: Point
    reason: Explanation
    planner: Name
    refused: Explanation
    status: NodeStatus
    response: PlannerResponse | None
    map_before: ids.Digest
    map_after: ids.Digest | None
    question: ids.Digest
    answer: ids.Digest


def choices(contract: TaskContract) -> dict[ids.NodeId, exploration.TargetChoice]:
    """The targets chosen so far, by leg, in order. Raises ContractInvalid for invalid bindings."""
    try:
        return msgspec.convert(contract.bindings.get(TARGETS, {}), dict[ids.NodeId, exploration.TargetChoice])
    except msgspec.ValidationError as error:
        raise ContractInvalid(because("choices_invalid", error=str(error)), where=f"bindings.{TARGETS}") from error


def decisions(mission: Mission) -> tuple[ExplorationDecision, ...]:
    """Every choice of this mission, oldest first."""
    after = {leg: update.after for leg, update in updates(mission)}
    return tuple(
        ExplorationDecision(
            mission_id=choice.mission_id,
            configuration=choice.configuration,
            k=choice.k,
            leg=leg,
            image=choice.image,
            target_m=choice.target_m,
            reason=choice.reason,
            planner=choice.planner,
            refused=choice.refused,
            status=mission.of(leg).status,
            response=_response(mission.of(leg)),
            map_before=choice.map,
            map_after=after.get(leg),
            question=choice.question,
            answer=choice.answer,
        )
        for leg, choice in choices(required_contract(mission)).items()
    )


def _response(leg: NodeState) -> PlannerResponse | None:
    executed = [packet for packet in leg.packets if not packet.verify_only]
    if not executed:
        return None
    packet = executed[-1]
    judged = [one for one in leg.verdicts if one.packet_id == packet.identity.packet_id]
    return PlannerResponse(
        provider_id=packet.identity.provider_id,
        packet_id=packet.identity.packet_id,
        terminal=packet.terminal,
        failure=packet.failure,
        verdict=judged[-1].verdict if judged else None,
    )


def updates(mission: Mission) -> tuple[tuple[ids.NodeId, exploration.MapUpdate], ...]:
    """The map updates of this mission, oldest first, each with the stage that it followed."""
    return tuple(
        (ids.NodeId(str(reference.values["after_stage"])), update_of(reference))
        for reference in mission.observed
        if is_update(reference)
    )


def is_update(reference: EvidenceReference) -> bool:
    """Whether a recorded observation is a map of an exploration."""
    return reference.kind == MAP and "after_stage" in reference.values


def update_of(reference: EvidenceReference) -> exploration.MapUpdate:
    """The map update that a reference records; its blob is the map after it."""
    values = {name: value for name, value in reference.values.items() if name != "after_stage"}
    lists = {name: str(values[name]).split() for name in ("packets", "sweeps")}
    return msgspec.convert({**values, **lists, "after": reference.blob}, exploration.MapUpdate)


def unmapped(mission: Mission) -> tuple[EvidencePacket, ...]:
    """Executions that left a trajectory and are in no map yet, in order of dispatch."""
    drawn = {packet for _, update in updates(mission) for packet in update.packets}
    packets = (packet for node in mission.nodes.values() for packet in node.packets)
    fresh = [packet for packet in packets if packet.estimates and packet.identity.packet_id not in drawn]
    return tuple(sorted(fresh, key=lambda packet: (packet.dispatched_s, packet.identity.packet_id)))


def feedback(mission: Mission) -> tuple[exploration.AnyFeedback, ...]:
    """Typed feedback on every target so far, in order: reached or blocked, then how the map changed on the way."""
    changes, chosen = updates(mission), choices(required_contract(mission))
    return tuple(
        word for leg, choice in chosen.items() for word in _leg_feedback(mission, mission.of(leg), choice, changes)
    )


def _leg_feedback(
    mission: Mission,
    leg: NodeState,
    choice: exploration.TargetChoice,
    changes: Sequence[tuple[ids.NodeId, exploration.MapUpdate]],
) -> Iterator[exploration.AnyFeedback]:
    if leg.status == "committed":
        arrival = next((fact for fact in mission.facts if fact.node_id == leg.node_id and fact.name == "arrival"), None)
        moved_m = arrival.measured.get("path_length_m", 0.0) if arrival else 0.0
        yield exploration.Reached(node_id=leg.node_id, target_m=choice.target_m, moved_m=moved_m)
    elif leg.status == "failed":
        last = leg.failures[-1]
        yield exploration.BlockedTarget(
            node_id=leg.node_id, target_m=choice.target_m, failure=last.failure, reason=last.reason
        )
    for after, change in changes:
        if after == leg.node_id and (change.opened_m2 or change.closed_m2):
            yield exploration.MapChanged(
                node_id=leg.node_id,
                target_m=choice.target_m,
                before=change.before,
                after=change.after,
                opened_m2=change.opened_m2,
                closed_m2=change.closed_m2,
            )


def views(mission: Mission) -> tuple[CommittedFact, ...]:
    """The accepted pictures, oldest first."""
    return tuple(fact for fact in mission.facts if fact.name == "pictured")


def newest_image(mission: Mission) -> ids.Digest | None:
    """The picture of the newest accepted view; None if there is none yet."""
    seen = views(mission)
    return ids.Digest(max(seen, key=lambda fact: fact.k).arguments["images"][-1]) if seen else None
