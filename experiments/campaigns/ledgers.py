"""Reads the log for an adjudicator: commits, budgets, leases and answers, folded without the harness's own folds.

It imports the shapes of events and nothing that decides, so a rule that is missing in the gate is still checked here.
"""

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec

from harness.contracts import events
from harness.contracts.any_events import AnyEvent
from harness.contracts.decider import Codec
from harness.contracts.errors import LogDamaged
from harness.contracts.evidence import EvidencePacket
from harness.contracts.handoff_events import HandoffApproved, HandoffRejected
from harness.contracts.lease_events import LeaseAcquired, LeaseFreed, LeaseQuarantined, LeaseReleased
from harness.contracts.ports import StoredEvent
from harness.contracts.retreat_events import RetreatIntended
from harness.contracts.revision_events import (
    AttestationRecorded,
    CompletionDisputed,
    ConstraintsTightened,
    GraphRevised,
)
from harness.contracts.stored_commands import without_command
from harness.contracts.tasks import Node, TaskContract
from rsi_reviews.events import CandidateEvent, PointerEvent
from rsi_reviews.refused_proposals import ProposalRefused
from rsi_reviews.suite_growth import CaseAdded

LEASES = "lease/"
_STRICT = {"low": 1, "medium": 1, "high": 2}
LEVEL = {1: {"low": 0, "medium": 1, "high": 2}, 2: _STRICT, 3: _STRICT, 4: _STRICT, 5: _STRICT, 6: _STRICT, 7: _STRICT}
"""What each risk class needs, by the version of the rules that the mission is pinned to."""
REVIEWS: dict[str, Codec[Any]] = {
    "candidate": Codec(CandidateEvent),
    "release": Codec(PointerEvent),
    "suite": Codec(CaseAdded),
    "refused": Codec(ProposalRefused),
}
"""What stands in the same log, by family of streams, and decides nothing of a mission."""
_DECODER: msgspec.json.Decoder[AnyEvent] = msgspec.json.Decoder(AnyEvent)


@dataclass
class Books:
    """Everything that the log records of one mission, and what is wrong with it."""

    created: events.MissionCreated | None = None
    contract: TaskContract | None = None
    intents: dict[str, events.DispatchIntended] = field(default_factory=dict)
    retreats: set[str] = field(default_factory=set)
    packets: dict[str, EvidencePacket] = field(default_factory=dict)
    committed: list[events.NodeCommitted] = field(default_factory=list)
    rules: int = 1
    standing: set[str] = field(default_factory=set)
    declared: set[str] = field(default_factory=set)
    granted: set[str] = field(default_factory=set)
    """Stages that a revision lets begin once more: it was paid for when it was made, before the dispatch."""
    rejected: list[events.CommitRejected] = field(default_factory=list)
    succeeded: bool = False
    partly: bool = False
    unauthorised: list[str] = field(default_factory=list)
    breaches: list[str] = field(default_factory=list)
    k: int = 0
    vetoes: set[str] = field(default_factory=set)
    spent: Counter[tuple[str, str]] = field(default_factory=Counter)
    relooks: int = 0

    def node(self, node_id: str) -> Node | None:
        nodes = self.contract.nodes if self.contract else ()
        return next((node for node in nodes if node.node_id == node_id), None)


def read_books(log: Sequence[StoredEvent], commits: Sequence[tuple[int, int]]) -> Books:
    """Fold the whole log, one commit at a time."""
    books, leases, answers = Books(), _Leases(), Counter[str]()
    for low, high in commits:
        together = []
        for stored in log[low:high]:
            family = stored.stream.partition("/")[0]
            if family in REVIEWS:
                books.breaches += _unreadable(stored, REVIEWS[family])
                continue
            try:
                together.append((stored.stream, _DECODER.decode(without_command(stored.body))))
            except msgspec.MsgspecError as error:
                books.breaches.append(f"{stored.kind} in the log cannot be read: {error}")
        for stream, event in together:
            if isinstance(event, LeaseAcquired | LeaseReleased | LeaseQuarantined | LeaseFreed):
                books.breaches.extend(leases.fold(stream, event))
            elif isinstance(event, HandoffApproved | HandoffRejected):
                answers[stream] += 1
        _fold(books, [event for _, event in together])
    books.breaches += [f"{stream} was answered {n} times" for stream, n in answers.items() if n > 1]
    return books


def _unreadable(stored: StoredEvent, codec: Codec[Any]) -> Iterator[str]:
    """An event of a release or a candidate, which decides nothing of a mission, must be read all the same."""
    try:
        codec.decode(stored)
    except LogDamaged as error:
        yield f"{stored.kind} in the log cannot be read: {error}"


def _fold(books: Books, together: Sequence[AnyEvent]) -> None:
    for event in together:
        match event:
            case events.MissionCreated():
                books.created = event
            case events.ContractCompiled():
                books.contract, books.rules = event.contract, event.rules
            case events.ContractRecompiled():
                books.contract, books.rules = event.contract, event.rules
                books.k += 1
            case events.DispatchIntended():
                books.breaches.extend(_dispatched(books, event, together))
                books.intents[event.invocation_id] = event
            case RetreatIntended():
                books.retreats.add(event.request_id)
            case events.PacketRetained():
                books.packets[event.packet.identity.packet_id] = event.packet
            case events.NodeCommitted():
                books.unauthorised.extend(_committed(books, event, together))
                books.committed.append(event)
                books.standing.add(event.node_id)
                books.k += 1
            case events.EffectDeclared():
                books.unauthorised.extend(_declared(books, event, together))
                books.declared.add(event.node_id)
                books.k += 1
            case GraphRevised():
                books.breaches.extend(_revised(books, event, together))
                books.k += 1
            case ConstraintsTightened() | AttestationRecorded() | CompletionDisputed():
                books.k += 1
            case events.CommitRejected():
                books.rejected.append(event)
                books.k += 1
            case events.RecoveryAuthorised():
                books.breaches.extend(_spent(books, event.node_id, event.action, event.cost))
                books.k += event.cost
            case events.MissionEnded(status="succeeded"):
                books.succeeded = True
                books.unauthorised.extend(_ended(books, together))
            case events.MissionEnded(status="partly_verified"):
                books.partly = True
                books.unauthorised.extend(_ended_partly(books))
            case events.VetoRaised():
                books.vetoes.add(event.layer)
                books.k += 1
            case events.VetoCleared():
                books.vetoes.discard(event.layer)
                books.k += 1
            case events.EpochChanged() | events.OperatorRetryGranted() | events.HandoffAnswered(decision="approved"):
                books.k += 1
            case events.ObservationRecorded():
                books.k += 1 if event.contradicts else 0
            case events.GoalVerified():
                books.relooks += event.relook
                books.k += event.relook
            case _:
                pass


def _committed(books: Books, event: events.NodeCommitted, together: Sequence[AnyEvent]) -> Iterator[str]:
    """Why this commit was not authorised: what the same commit does not show."""
    where = f"commit of {event.node_id}"
    packet = next(
        (
            e.packet
            for e in together
            if isinstance(e, events.PacketRetained) and e.packet.identity.packet_id == event.packet_id
        ),
        None,
    )
    verdict = next(
        (
            e.verdict
            for e in together
            if isinstance(e, events.VerdictRecorded) and e.invocation_id == event.invocation_id
        ),
        None,
    )
    node, intent = books.node(event.node_id), books.intents.get(event.invocation_id)
    if packet is None or verdict is None or node is None or intent is None or books.created is None:
        yield f"{where}: packet, verdict or intent is not there"
        return
    results = verdict.results
    if verdict.verdict != "satisfied" or any(result.verdict != "satisfied" for result in results):
        yield f"{where}: the verdict is {verdict.verdict}"
    if sorted(r.condition_id for r in results) != sorted(c.condition_id for c in node.success_conditions):
        yield f"{where}: the verdict covers other conditions than the contract's"
    if any(result.independence < LEVEL[books.rules][node.risk] for result in results):
        yield f"{where}: a condition rests on too few sources"
    if (packet.k_ctx, intent.k_ctx) != (books.k, books.k):
        yield f"{where}: packet of version {packet.k_ctx}, intent of {intent.k_ctx}, mission at {books.k}"
    if packet.configuration != books.created.configuration:
        yield f"{where}: made under another configuration"
    if _identity(packet, verdict.packet_id) != _expected(books.created.mission_id, event, intent):
        yield f"{where}: the packet is about somebody else"
    if packet.terminal != "succeeded":
        yield f"{where}: the execution ended {packet.terminal}"
    if books.vetoes:
        yield f"{where}: {', '.join(sorted(books.vetoes))} vetoed"


def _declared(books: Books, event: events.EffectDeclared, together: Sequence[AnyEvent]) -> Iterator[str]:
    """Why this stage may not end declared: what its contract does not name, or what was not otherwise shown."""
    where = f"declared end of {event.node_id}"
    verdict = next(
        (
            e.verdict
            for e in together
            if isinstance(e, events.VerdictRecorded) and e.invocation_id == event.invocation_id
        ),
        None,
    )
    packets = (e.packet for e in together if isinstance(e, events.PacketRetained))
    packet = next((one for one in packets if one.identity.packet_id == event.packet_id), None)
    node = books.node(event.node_id)
    if verdict is None or packet is None or node is None:
        yield f"{where}: packet, verdict or node is not there"
        return
    named = {effect.condition_id for effect in event.effects}
    if books.rules < 2 or not named or not named <= node.declared:
        yield f"{where}: the evidence policy does not name {', '.join(sorted(named - node.declared)) or 'it'}"
    results = {result.condition_id: result for result in verdict.results}
    if results.keys() != {condition.condition_id for condition in node.success_conditions}:
        yield f"{where}: the verdict covers other conditions than the contract's"
    if any(one.verdict != "satisfied" for name, one in results.items() if name not in named):
        yield f"{where}: another condition is not satisfied"
    if any(one.verdict != "ambiguous" for name, one in results.items() if name in named):
        yield f"{where}: it was decided otherwise"
    if packet.k_ctx != books.k or packet.terminal != "succeeded" or books.vetoes:
        yield f"{where}: of version {packet.k_ctx} at {books.k}, {packet.terminal}, vetoes {sorted(books.vetoes)}"


def _ended_partly(books: Books) -> Iterator[str]:
    """Why a mission may not end verified in part: nothing is declared, or something is not even that."""
    if not books.declared:
        yield "an end in part without a declared stage"
    over = books.standing | books.declared
    nodes = books.contract.nodes if books.contract else ()
    missing = [node.node_id for node in nodes if node.required and node.node_id not in over]
    if missing:
        yield f"an end in part without {', '.join(missing)}"


def _identity(packet: EvidencePacket, judged: str) -> tuple[object, ...]:
    who = packet.identity
    return (
        who.mission_id, who.node_id, who.attempt, who.request_id, who.invocation_id, who.provider_id,
        who.provider_version, who.packet_id, judged,
    )  # fmt: skip


def _expected(mission_id: str, event: events.NodeCommitted, intent: events.DispatchIntended) -> tuple[object, ...]:
    request = hashlib.sha256(f"{mission_id}\n{intent.node_id}\n{intent.attempt}".encode()).hexdigest()
    return (
        mission_id, event.node_id, intent.attempt, request, event.invocation_id, intent.provider_id,
        intent.provider_version, event.packet_id, event.packet_id,
    )  # fmt: skip


def _ended(books: Books, together: Sequence[AnyEvent]) -> Iterator[str]:
    """Why this success was not earned."""
    contract = books.contract
    verdict = next((event.verdict for event in together if isinstance(event, events.GoalVerified)), None)
    if contract is None or verdict is None:
        yield "success without a goal verdict in the same commit"
        return
    if verdict.verdict != "satisfied" or any(result.verdict != "satisfied" for result in verdict.results):
        yield f"success on a goal verdict {verdict.verdict}"
    required = sorted(condition.condition_id for condition in contract.completion_conditions)
    if sorted(result.condition_id for result in verdict.results) != required:
        yield "success without the original completion conditions"
    missing = [node.node_id for node in contract.nodes if node.required and node.node_id not in books.standing]
    if missing:
        yield f"success without {', '.join(missing)}"
    if books.vetoes:
        yield "success under a veto"
    if books.declared:
        yield f"success with {', '.join(sorted(books.declared))} declared"


def _dispatched(books: Books, intent: events.DispatchIntended, together: Sequence[AnyEvent]) -> Iterator[str]:
    """Why this dispatch should not have been made."""
    taken = {event.resource: event.token for event in together if isinstance(event, LeaseAcquired)}
    where = f"dispatch of {intent.node_id}, attempt {intent.attempt}"
    robot_id = books.created.robot_id if books.created else ""
    if taken != {f"{robot_id}/{resource}": token for resource, token in intent.resources.items()}:
        yield f"{where}: leases {taken} for resources {intent.resources} of {robot_id}"
    if books.vetoes:
        yield f"{where}: under a veto"
    paid = any(isinstance(event, events.RecoveryAuthorised | events.OperatorRetryGranted) for event in together)
    if intent.attempt > 1 and not paid and intent.node_id not in books.granted:
        yield f"{where}: nobody authorised a further attempt"
    books.granted.discard(intent.node_id)


def _revised(books: Books, event: GraphRevised, together: Sequence[AnyEvent]) -> Iterator[str]:
    """Reopened stages no longer count as done. The responsible one pays: by itself, or with a step of this commit."""
    books.contract = event.contract or books.contract
    books.standing -= set(event.reopened)
    books.declared -= set(event.reopened)
    books.granted |= {event.responsible, *event.reopened}
    if event.cause != "recovery":
        yield from _spent(books, event.responsible, "local_replan", 1)
        return
    steps = [one for one in together if isinstance(one, events.RecoveryAuthorised) and one.node_id == event.responsible]
    if not any(step.cost for step in steps):
        yield f"revision {event.revision} for {event.responsible}: no step of its commit paid for it"


def _spent(books: Books, node_id: str, action: str, cost: int) -> Iterator[str]:
    """The budget that this spend exceeds."""
    node = books.node(node_id)
    if node is None or books.contract is None or not cost:
        return
    books.spent[node_id, action] += cost
    times = books.spent[node_id, action]
    limits: dict[str, int] = msgspec.to_builtins(node.recovery)
    if times > limits.get(action, 0):
        yield f"{action} of {node_id} was spent {times} times, {limits.get(action, 0)} are allowed"
    total = sum(n for (name, _), n in books.spent.items() if name == node_id)
    if total > node.recovery.total:
        yield f"{node_id} spent {total} of {node.recovery.total}"
    whole = sum(books.spent.values()) + books.relooks
    if whole > books.contract.recovery_total:
        yield f"the mission spent {whole} of {books.contract.recovery_total}"


def exclusive_leases(log: Sequence[StoredEvent]) -> Iterator[str]:
    """Over a whole log, whoever wrote it: two holders of one resource at once, and tokens that did not rise."""
    leases = _Leases()
    for stored in log:
        if stored.stream.startswith(LEASES):
            event = _DECODER.decode(without_command(stored.body))
            if isinstance(event, LeaseAcquired | LeaseReleased | LeaseQuarantined | LeaseFreed):
                yield from leases.fold(stored.stream, event)


class _Leases:
    """Which holder has which resource, by the events alone."""

    def __init__(self) -> None:
        self._holder: dict[str, str] = {}
        self._token: Counter[str] = Counter()

    def fold(self, stream: str, event: LeaseAcquired | LeaseReleased | LeaseQuarantined | LeaseFreed) -> Iterator[str]:
        if isinstance(event, LeaseAcquired):
            if stream in self._holder:
                yield f"{stream} was given to {event.invocation_id} while {self._holder[stream]} had it"
            if event.token <= self._token[stream]:
                yield f"{stream} was given with token {event.token} after {self._token[stream]}"
            self._holder[stream] = event.invocation_id
            self._token[stream] = event.token
        elif isinstance(event, LeaseReleased | LeaseFreed):
            self._holder.pop(stream, None)
