"""Asks the independent sources what a stage left in the world, for its packet and again for the goal (D17)."""

from collections.abc import Iterable

from harness.contracts.errors import HarnessError
from harness.contracts.evidence import EvidencePacket, EvidenceReference
from harness.contracts.ids import Digest, NodeId, RequestId, sha256
from harness.contracts.measurements import Measurement
from harness.contracts.ports import IndependentSource
from harness.projections.mission import Invocation, Mission, required_contract
from harness.supervisor.observations import ObservationBuffer
from harness.supervisor.robot_connection import RobotConnection


class Measurements:
    """One robot's independent sources. A source that fails leaves no measurement: the condition is then undecided."""

    def __init__(self, *, connection: RobotConnection, observations: ObservationBuffer) -> None:
        self._connection, self._observations = connection, observations

    def of_invocation(
        self, mission: Mission, invocation: Invocation, *, until_s: float
    ) -> tuple[EvidenceReference, ...]:
        """What the conditions of the stage need. A look that executes nothing asks about the execution before it."""
        intent = invocation.intent
        found: list[EvidenceReference] = []
        for source in self._sources(mission, intent.node_id):
            if intent.verify_only:
                requests, asked = _asked_before(mission, intent.node_id)
            else:
                requests, asked = (intent.request_id,), sha256(str(intent.parameters.get("text", "")).encode())
            found += self._measured(source, requests, asked, from_s=intent.dispatched_s, until_s=until_s)
        return tuple(found)

    def of_goal(self, mission: Mission) -> tuple[EvidenceReference, ...]:
        """What may have changed since the stages were accepted, measured once more."""
        now_s = self._connection.clock.now().mission_s
        wanted = {one.effect.predicate for one in required_contract(mission).completion_conditions}
        found: list[EvidenceReference] = []
        for node in required_contract(mission).nodes:
            if mission.of(node.node_id).status != "committed":
                continue
            for source in self._sources(mission, node.node_id):
                if source.lasting and source.predicate in wanted:
                    requests, asked = _asked_before(mission, node.node_id)
                    found += self._measured(source, requests, asked, from_s=now_s, until_s=now_s)
        return tuple(found)

    def _sources(self, mission: Mission, node_id: NodeId) -> Iterable[IndependentSource]:
        conditions = required_contract(mission).node(node_id).success_conditions
        wanted = {one.effect.predicate for one in conditions}
        return (source for source in self._connection.sources if source.predicate in wanted)

    def _measured(
        self,
        source: IndependentSource,
        requests: tuple[RequestId, ...],
        asked: Digest,
        *,
        from_s: float,
        until_s: float,
    ) -> list[EvidenceReference]:
        measurement = Measurement(
            requests=requests,
            asked_text=asked,
            from_s=from_s,
            until_s=until_s,
            samples=self._observations.recent,
            status=self._observations.status,
        )
        try:
            return list(source.measure(measurement))
        except HarnessError:
            return []


def _asked_before(mission: Mission, node_id: NodeId) -> tuple[tuple[RequestId, ...], Digest]:
    """The newest execution's request, and the checksum of what it was asked to send or say."""
    executed = [packet for packet in mission.of(node_id).packets if not packet.verify_only]
    if not executed:
        return (), sha256(b"")
    return (executed[-1].identity.request_id,), _text(executed[-1])


def _text(packet: EvidencePacket) -> Digest:
    stated = [str(one.values["asked_text"]) for one in packet.after if "asked_text" in one.values]
    return Digest(stated[-1]) if stated else sha256(b"")
