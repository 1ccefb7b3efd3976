"""Asks the independent sources what a stage left in the world, for its packet and again for the goal (D17)."""

from collections.abc import Iterable

from msgspec.structs import replace

from harness.contracts.errors import HarnessError
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, NodeId
from harness.contracts.measurements import Measurement
from harness.contracts.ports import IndependentSource
from harness.contracts.protocol import InvocationReport
from harness.projections.mission import Invocation, Mission, required_contract
from harness.supervisor.roles import RoleContexts


class IndependentMeasurements:
    """One robot's independent sources. A source that fails leaves no measurement: the condition is then undecided."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles, self._runtime, self._connection = roles, roles.runtime, roles.connection

    def of_invocation(
        self, mission: Mission, invocation: Invocation, *, report: InvocationReport, until_s: float
    ) -> tuple[EvidenceReference, ...]:
        """What the conditions of the stage need. A look that executes nothing asks about the execution before it."""
        intent = invocation.intent
        measurement = Measurement(
            requests=(intent.request_id,),
            text=str(intent.parameters.get("text", "")),
            from_s=intent.dispatched_s,
            until_s=until_s,
            receipts=report.receipts,
            channel=str(intent.parameters.get("channel", "")),
        )
        if intent.verify_only:
            measurement = self._again(mission, intent.node_id, from_s=intent.dispatched_s, until_s=until_s)
        return self._measured(mission, self._sources(mission, intent.node_id), measurement)

    def of_goal(self, mission: Mission) -> tuple[EvidenceReference, ...]:
        """What may have changed since the stages were accepted, measured once more."""
        now_s = self._connection.clock.now().mission_s
        contract = required_contract(mission)
        predicates = {one.effect.predicate for one in contract.completion_conditions}
        found: list[EvidenceReference] = []
        for node in contract.nodes:
            sources = [
                one for one in self._sources(mission, node.node_id) if one.lasting and one.predicate in predicates
            ]
            if sources and mission.of(node.node_id).status == "committed":
                measurement = self._again(mission, node.node_id, from_s=now_s, until_s=now_s)
                found += self._measured(mission, sources, measurement)
        return tuple(found)

    def _sources(self, mission: Mission, node_id: NodeId) -> list[IndependentSource]:
        conditions = required_contract(mission).node(node_id).success_conditions
        predicates = {one.effect.predicate for one in conditions}
        return [source for source in self._connection.sources if source.predicate in predicates]

    def _measured(
        self, mission: Mission, sources: Iterable[IndependentSource], measurement: Measurement
    ) -> tuple[EvidenceReference, ...]:
        places = self._runtime.site_of(mission).places
        observations = self._roles.observations
        completed = replace(
            measurement,
            names=tuple(place.name for place in places),
            samples=observations.recent,
            status=observations.status,
        )
        found: list[EvidenceReference] = []
        for source in sources:
            try:
                found += source.measure(completed)
            except HarnessError:
                continue
        return tuple(found)

    def _again(self, mission: Mission, node_id: NodeId, *, from_s: float, until_s: float) -> Measurement:
        """The question about the newest execution of a stage, asked once more."""
        executed = [packet for packet in mission.of(node_id).packets if not packet.verify_only]
        measurement = Measurement(requests=(), text="", from_s=from_s, until_s=until_s, executes=False)
        if not executed:
            return measurement
        packet = executed[-1]
        texts = [Digest(str(one.values["asked_text"])) for one in packet.after if "asked_text" in one.values]
        text = self._runtime.blob(texts[-1]).decode() if texts else ""
        channels = [str(one.values["channel"]) for one in packet.after if "channel" in one.values]
        return replace(
            measurement,
            requests=(packet.identity.request_id,),
            text=text,
            receipts=packet.receipts,
            channel=channels[-1] if channels else "",
        )
