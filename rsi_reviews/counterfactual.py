"""Finds stored decisions that would have come out differently under a candidate. Commands no robot and starts nothing.

Every decision is derived again from what was stored with it: the routing question, the contexts, the failures. Up to a
mission's first difference, the result is what would have happened. After it, the mission would have taken another
course.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar

from msgspec.structs import replace

from harness.contexts.recovery import LadderState
from harness.contracts import events
from harness.contracts.configuration import Configuration
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.decider import Codec
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.ids import Digest, MissionId, NodeId, StreamId
from harness.contracts.ports import Record, StoredEvent
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Count, Value, decode, raw
from harness.planning.planner import plan
from harness.projections.mission import Mission
from harness.recovery.ladder import recover
from harness.routing.question import RoutingQuestion

T = TypeVar("T")
Kind = Literal["routing", "recovery", "wait", "timeout", "context", "plan"]
KINDS: tuple[Kind, ...] = ("routing", "recovery", "wait", "timeout", "context", "plan")
_CODEC: Codec[events.MissionEvent] = Codec(events.MissionEvent)


class MissionRecords(Protocol):
    """The records of the log that this module reads."""

    def streams(self, prefix: str) -> list[StreamId]: ...

    def events(self, mission_id: MissionId) -> list[StoredEvent]: ...

    def mission(self, mission_id: MissionId) -> Mission: ...

    def record(self, digest: Digest) -> Record: ...


class DecisionDifference(Value):
    """One decision that would differ: its position in the log, what it was and what it would be."""

    position: Count
    kind: Kind
    node_id: str
    before: str
    after: str


class MissionCounterfactual(Value):
    """One mission: decisions derived again by kind, those that differ, and those whose records cannot be read."""

    mission_id: MissionId
    template: str
    status: str
    derived: dict[Kind, Count]
    differences: tuple[DecisionDifference, ...]
    unreadable: tuple[Reason, ...] = ()


class Counterfactual(Value):
    """All missions that were looked at, oldest first, under one configuration."""

    configuration: Digest
    missions: tuple[MissionCounterfactual, ...]

    @property
    def differing(self) -> tuple[MissionCounterfactual, ...]:
        """Missions with a difference."""
        return tuple(mission for mission in self.missions if mission.differences)


def counterfactual(
    runtime: MissionRecords, configuration: Configuration, missions: Iterable[MissionId] | None = None
) -> Counterfactual:
    """Derive the decisions of these missions again, of all stored ones without a list. Raises UnknownName."""
    if missions is None:
        missions = [MissionId(stream.partition("/")[2]) for stream in runtime.streams("mission/")]
    return Counterfactual(
        configuration=configuration.configuration_id,
        missions=tuple(_mission(runtime, configuration, mission_id) for mission_id in missions),
    )


def _mission(runtime: MissionRecords, configuration: Configuration, mission_id: MissionId) -> MissionCounterfactual:
    stored = runtime.events(mission_id)
    if not stored:
        raise UnknownName(because("unknown_mission", mission_id=mission_id))
    again = _Again(runtime, configuration)
    differences: list[DecisionDifference] = []
    unreadable: list[Reason] = []
    template = ""
    for one in stored:
        event = _CODEC.decode(one)
        if isinstance(event, events.MissionCreated):
            template = event.template
        try:
            differences += again.differences(one, event)
        except HarnessError as error:
            unreadable.append(because("decision_unreadable", position=one.position, reason=error.located))
    return MissionCounterfactual(
        mission_id=mission_id,
        template=template,
        status=runtime.mission(mission_id).status,
        derived=again.derived,
        differences=tuple(differences),
        unreadable=tuple(unreadable),
    )


@dataclass
class _Again:
    """Derives one mission's decisions again under the other configuration."""

    runtime: MissionRecords
    configuration: Configuration

    def __post_init__(self) -> None:
        self.derived: dict[Kind, int] = dict.fromkeys(KINDS, 0)
        self._template = ""
        self._timeouts: dict[str, float] = {}

    def differences(self, stored: StoredEvent, event: events.MissionEvent) -> Iterator[DecisionDifference]:
        """Differences of one event. Raises HarnessError if a record it rests on cannot be read."""
        match event:
            case events.MissionCreated(template=template):
                self._template = template
            case events.ContractCompiled(contract=contract):
                self._timeouts = {node.node_id: node.timeout_s for node in contract.nodes}
            case events.NodePlanned():
                yield from self._plan(stored, event)
            case events.DispatchIntended():
                yield from self._timeout(stored, event)
                yield from self._routing(stored, event)
                yield from self._context_differences(stored, event.context, node_id=event.node_id)
            case events.VerdictRecorded(verdict=verdict):
                yield from self._context_differences(stored, verdict.context, node_id=None)
            case events.RecoveryAuthorised() | events.HandoffRequested() | events.NodeFailed():
                yield from self._recovery(stored, event)
            case _:
                return

    def _plan(self, stored: StoredEvent, event: events.NodePlanned) -> Iterator[DecisionDifference]:
        c1 = self._stored(event.context, Context)
        yield from self._context_differences(stored, event.context, node_id=event.node_id)
        self.derived["plan"] += 1
        before, after = plan(c1).node_id, plan(self._narrowed(c1)).node_id
        if before != after:
            yield _difference(stored, "plan", event.node_id, before=before or "nothing", after=after or "nothing")

    def _routing(self, stored: StoredEvent, event: events.DispatchIntended) -> Iterator[DecisionDifference]:
        """The same routing question under the other weights, and the other timeout that latency is measured against."""
        if event.question is None:
            return
        question = self._stored(event.question, RoutingQuestion)
        node = question.need.node
        need = replace(question.need, node=replace(node, timeout_s=self._timeout_of(node.node_id) or node.timeout_s))
        other = replace(question, need=need, preferences=self.configuration.routing)
        self.derived["routing"] += 1
        before, after = question.answer().chosen, other.answer().chosen
        if before != after:
            yield _difference(stored, "routing", event.node_id, before=before or "nobody", after=after or "nobody")

    def _timeout(self, stored: StoredEvent, event: events.DispatchIntended) -> Iterator[DecisionDifference]:
        if event.verify_only:
            return
        self.derived["timeout"] += 1
        before, after = self._timeouts.get(event.node_id), self._timeout_of(event.node_id)
        if before is not None and after is not None and before != after:
            yield _difference(stored, "timeout", event.node_id, before=f"{before:g} s", after=f"{after:g} s")

    def _recovery(
        self, stored: StoredEvent, event: events.RecoveryAuthorised | events.HandoffRequested | events.NodeFailed
    ) -> Iterator[DecisionDifference]:
        if event.context is None:
            return
        c4 = self._stored(event.context, Context)
        other = self._narrowed(self._on_other_ladder(c4))
        self.derived["recovery"] += 1
        before, after = recover(c4), recover(other)
        if _words(before) != _words(after):
            yield _difference(stored, "recovery", event.node_id, before=_words(before), after=_words(after))
        elif before.action == "wait":
            yield from self._wait(stored, c4, event.node_id)
        yield from self._context_differences(stored, event.context, node_id=event.node_id)

    def _wait(self, stored: StoredEvent, c4: Context, node_id: NodeId) -> Iterator[DecisionDifference]:
        ladder = c4.one("ladder")
        if ladder is None:
            return
        self.derived["wait"] += 1
        before, after = ladder.read(LadderState).wait_s, self.configuration.recovery.wait_s
        if before != after:
            yield _difference(stored, "wait", node_id, before=f"{before:g} s", after=f"{after:g} s")

    def _context_differences(
        self, stored: StoredEvent, name: Digest, *, node_id: NodeId | None
    ) -> Iterator[DecisionDifference]:
        """The records that the role would have been shown; those withheld for the budget are known by kind only."""
        context = self._stored(name, Context)
        other = self._narrowed(context)
        self.derived["context"] += 1
        budget = self._budget(context)
        waiting = [one.kind for one in context.withheld if one.reason == "budget"]
        room = max(0, budget - len(other.records))
        lost = [one.kind for one in context.records if one not in other.records]
        gained = waiting[-room:] if room else []
        if lost or gained:
            change = [f"without {kind}" for kind in lost] + [f"with {kind}" for kind in gained]
            before = f"{context.role}: {len(context.records)} records"
            yield _difference(
                stored, "context", node_id or "", before=before, after=f"{context.role}: {', '.join(change)}"
            )

    def _narrowed(self, context: Context) -> Context:
        """The context under the candidate's context rules, as far as these rules remove something."""
        least = self.configuration.context_rules.minimum_confidence
        records = [one for one in context.records if one.confidence >= least]
        excess = len(records) - self._budget(context)
        optional = sorted((one for one in records if not one.mandatory), key=lambda one: one.at_s)
        dropped = optional[:excess] if excess > 0 else []
        return replace(context, records=tuple(one for one in records if not any(one is other for other in dropped)))

    def _on_other_ladder(self, c4: Context) -> Context:
        return replace(c4, records=tuple(self._climbed(record) for record in c4.records))

    def _climbed(self, record: ContextRecord) -> ContextRecord:
        if record.kind != "ladder":
            return record
        policy, state = self.configuration.recovery, record.read(LadderState)
        value: dict[str, Any] = {
            **record.content,
            "rungs": list(policy.ladders.get(state.failure, ("human",))),
            "approval_share": policy.approval_share,
            "wait_s": policy.wait_s,
        }
        return replace(record, value=raw(value))

    def _budget(self, context: Context) -> int:
        rules = self.configuration.context_rules
        budgets = {
            "planner": rules.c1_items,
            "skill": rules.c2_items,
            "verifier": rules.c3_items,
            "recovery": rules.c4_items,
        }
        return budgets[context.role]

    def _timeout_of(self, node_id: str) -> float | None:
        """The candidate's timeout of a stage of this mission's template, as far as it has such a stage."""
        nodes = [node for one in self.configuration.templates if one.name == self._template for node in one.nodes]
        found = next((node for node in nodes if node.get("node_id") == node_id), None)
        return float(found["timeout_s"]) if found is not None else None

    def _stored(self, name: Digest, kind: type[T]) -> T:
        return decode(self.runtime.record(name).body, kind)


def _words(proposal: RecoveryProposal) -> str:
    return f"{proposal.action} by {proposal.provider_id}" if proposal.provider_id else proposal.action


def _difference(stored: StoredEvent, kind: Kind, node_id: str, *, before: str, after: str) -> DecisionDifference:
    return DecisionDifference(position=stored.position, kind=kind, node_id=node_id, before=before, after=after)
