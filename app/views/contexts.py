"""Pure: what each role was shown (C1 to C4) when it decided, and which providers were looked at, as recorded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from app.views.saying import reasoned, said, word
from app.views.timeline import Entry
from harness.contracts.contexts import Context, ContextRecord, Role
from harness.contracts.events import DispatchIntended, GoalVerified, NodePlanned, RecoveryAuthorised, VerdictRecorded
from harness.contracts.ids import Digest
from harness.contracts.proposals import CandidateSet

ReadContext = Callable[[Digest], Context | None]
ReadCandidates = Callable[[Digest], CandidateSet | None]
ROLES = {"planner": "C1 planner", "skill": "C2 skill", "verifier": "C3 verifier", "recovery": "C4 recovery"}


@dataclass(frozen=True)
class Item:
    """One record of a context, as the role saw it."""

    kind: str
    origin: str
    source: str
    age_s: float
    confidence: float
    mandatory: bool
    value: Any


@dataclass(frozen=True)
class Kept:
    """What the compiler kept out, and why."""

    kind: str
    source: str
    reason: str
    detail: str


@dataclass(frozen=True)
class ContextView:
    """One stored context. `missing` is true when the log names it but holds no record of it."""

    role: str
    decision: str
    position: int
    digest: str
    k: int
    items: tuple[Item, ...]
    withheld: tuple[Kept, ...]
    missing: bool


@dataclass(frozen=True)
class Scored:
    """One provider that passed the filter, with its score term by term."""

    provider: str
    score: float
    terms: tuple[tuple[str, float], ...]
    chosen: bool


@dataclass(frozen=True)
class Filtered:
    """One provider that the hard filter refused, and why."""

    provider: str
    refused_by: str
    reason: str


@dataclass(frozen=True)
class Choice:
    """One candidate set, best first."""

    position: int
    k: int
    scored: tuple[Scored, ...]
    refused: tuple[Filtered, ...]


@dataclass(frozen=True)
class ContextsView:
    """All decisions about one stage, newest first."""

    node_id: str
    contexts: tuple[ContextView, ...]
    choices: tuple[Choice, ...]


def contexts(entries: Sequence[Entry], *, node_id: str, read: ReadContext, candidates: ReadCandidates) -> ContextsView:
    """Contexts and candidate sets of one node, from the records that were stored with the decisions."""
    shown: list[ContextView] = []
    choices: list[Choice] = []
    owner: dict[str, str] = {}
    for entry in entries:
        if isinstance(entry.event, DispatchIntended):
            owner[entry.event.invocation_id] = entry.event.node_id
        cited = _cited(entry, owner)
        if cited is None or cited.node_id != node_id:
            continue
        shown.append(_context(entry.position, cited, read=read))
        if isinstance(entry.event, NodePlanned) and (found := candidates(entry.event.candidates)):
            choices.append(_choice(entry.position, found))
    return ContextsView(node_id=node_id, contexts=tuple(reversed(shown)), choices=tuple(reversed(choices)))


def goal_context(entries: Sequence[Entry], *, read: ReadContext) -> ContextView | None:
    """What the goal verifier was shown, if it has answered."""
    for entry in reversed(entries):
        if isinstance(entry.event, GoalVerified):
            cited = _Cited("", "verifier", "verified the goal", entry.event.verdict.context)
            return _context(entry.position, cited, read=read)
    return None


@dataclass(frozen=True)
class _Cited:
    """A context that an event names: for which node, which role saw it, what it decided."""

    node_id: str
    role: Role
    decision: str
    digest: Digest


def _cited(entry: Entry, owner: dict[str, str]) -> _Cited | None:
    match entry.event:
        case NodePlanned() as event:
            return _Cited(event.node_id, "planner", "chose the stage and its provider", event.context)
        case DispatchIntended() as event:
            return _Cited(
                event.node_id,
                "skill",
                said("set the parameters of attempt {count}", count=event.attempt),
                event.context,
            )
        case VerdictRecorded() as event:
            node = owner.get(event.invocation_id, "")
            return _Cited(
                node,
                "verifier",
                said("judged the packet {verdict}", verdict=event.verdict.verdict),
                event.verdict.context,
            )
        case RecoveryAuthorised() as event:
            return _Cited(
                event.node_id, "recovery", said("proposed {action}", action=word(event.action)), event.context
            )
        case _:
            return None


def _context(position: int, cited: _Cited, *, read: ReadContext) -> ContextView:
    context = read(cited.digest)
    return ContextView(
        role=ROLES[context.role if context else cited.role],
        decision=cited.decision,
        position=position,
        digest=cited.digest,
        k=context.k if context else 0,
        items=tuple(_item(record, context.at_s) for record in context.records) if context else (),
        withheld=tuple(Kept(w.kind, w.source, w.reason, reasoned(w.detail)) for w in context.withheld)
        if context
        else (),
        missing=context is None,
    )


def _item(record: ContextRecord, at_s: float) -> Item:
    return Item(
        kind=record.kind,
        origin=record.origin,
        source=record.source,
        age_s=max(at_s - record.at_s, 0.0),
        confidence=record.confidence,
        mandatory=record.mandatory,
        value=record.value,
    )


def _choice(position: int, found: CandidateSet) -> Choice:
    return Choice(
        position=position,
        k=found.k,
        scored=tuple(
            Scored(
                provider=f"{one.provider_id} {one.version}",
                score=one.score,
                terms=tuple(one.terms.items()),
                chosen=one.provider_id == found.chosen,
            )
            for one in found.candidates
            if one.score is not None
        ),
        refused=tuple(
            Filtered(
                provider=f"{one.provider_id} {one.version}", refused_by=one.refused_by, reason=reasoned(one.reason)
            )
            for one in found.candidates
            if one.score is None
        ),
    )
