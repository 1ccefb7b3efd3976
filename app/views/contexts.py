"""Shapes what each role was shown (C1 to C4) when it decided, and which providers were considered."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, word
from app.views.timeline import TimelineEntry
from harness.contracts import events
from harness.contracts.contexts import Context, Role
from harness.contracts.ids import Digest
from harness.contracts.proposals import CandidateSet, RoutingExplanation

ReadContext = Callable[[Digest], Context | None]
ReadCandidates = Callable[[Digest], CandidateSet | None]
Explain = Callable[[Digest, CandidateSet], RoutingExplanation | None]
ROLES = {
    "planner": N_("C1 planner"),
    "skill": N_("C2 skill"),
    "verifier": N_("C3 verifier"),
    "recovery": N_("C4 recovery"),
}


@dataclass(frozen=True)
class ContextView:
    """One context that a role was shown, and what it decided. `context` is None where the log holds no record of it."""

    role: str
    decision: str
    position: int
    digest: str
    context: Context | None


@dataclass(frozen=True)
class RankedCandidates:
    """One candidate set, best first: those that passed the hard filter with their scores, and those it refused.

    `why` is None where the log holds no record of what routing was asked.
    """

    position: int
    found: CandidateSet
    why: RoutingExplanation | None = None


@dataclass(frozen=True)
class ContextsView:
    """All decisions about one stage, newest first."""

    node_id: str
    contexts: tuple[ContextView, ...]
    choices: tuple[RankedCandidates, ...]


def contexts(
    entries: Sequence[TimelineEntry],
    *,
    node_id: str,
    read: ReadContext,
    candidates: ReadCandidates,
    explain: Explain,
) -> ContextsView:
    """Contexts and candidate sets of one node, from the records that were stored with the decisions."""
    views: list[ContextView] = []
    owner: dict[str, str] = {}
    for entry in entries:
        if isinstance(entry.event, events.DispatchIntended):
            owner[entry.event.invocation_id] = entry.event.node_id
        cited = _cited(entry, owner)
        if cited is None or cited.node_id != node_id:
            continue
        views.append(_context(entry.position, cited, read=read))
    choices = ranked(entries, node_id=node_id, candidates=candidates, explain=explain)
    return ContextsView(node_id=node_id, contexts=tuple(reversed(views)), choices=tuple(reversed(choices)))


def ranked(
    entries: Sequence[TimelineEntry], *, node_id: str, candidates: ReadCandidates, explain: Explain
) -> tuple[RankedCandidates, ...]:
    """Every routing decision about one node, oldest first; a look after an execution chooses nobody anew."""
    choices: dict[Digest, RankedCandidates] = {}
    for entry in entries:
        match entry.event:
            case events.NodePlanned(node_id=node, candidates=name) if node == node_id and (found := candidates(name)):
                choices[name] = RankedCandidates(position=entry.position, found=found)
            case events.DispatchIntended(node_id=node, verify_only=False, candidates=str() as name) as event if (
                node == node_id and (found := candidates(name))
            ):
                why = explain(event.question, found) if event.question else None
                choices[name] = RankedCandidates(position=entry.position, found=found, why=why)
    return tuple(choices.values())


def goal_context(entries: Sequence[TimelineEntry], *, read: ReadContext) -> ContextView | None:
    """What the goal verifier was shown, if it has answered."""
    for entry in reversed(entries):
        if isinstance(entry.event, events.GoalVerified):
            cited = _ContextReference("", "verifier", N_("verified the goal"), entry.event.verdict.context)
            return _context(entry.position, cited, read=read)
    return None


@dataclass(frozen=True)
class _ContextReference:
    """A context that an event names: for which node, which role saw it, what it decided."""

    node_id: str
    role: Role
    decision: str
    digest: Digest


def _cited(entry: TimelineEntry, owner: dict[str, str]) -> _ContextReference | None:
    match entry.event:
        case events.NodePlanned() as event:
            return _ContextReference(event.node_id, "planner", N_("chose the stage and its provider"), event.context)
        case events.DispatchIntended() as event:
            return _ContextReference(
                event.node_id,
                "skill",
                lazy_gettext("set the parameters of attempt {count}", count=event.attempt),
                event.context,
            )
        case events.VerdictRecorded() as event:
            node = owner.get(event.invocation_id, "")
            return _ContextReference(
                node,
                "verifier",
                lazy_gettext("judged the packet {verdict}", verdict=event.verdict.verdict),
                event.verdict.context,
            )
        case events.RecoveryAuthorised() as event:
            return _ContextReference(
                event.node_id, "recovery", lazy_gettext("proposed {action}", action=word(event.action)), event.context
            )
        case _:
            return None


def _context(position: int, cited: _ContextReference, *, read: ReadContext) -> ContextView:
    context = read(cited.digest)
    return ContextView(
        role=ROLES[context.role if context else cited.role],
        decision=cited.decision,
        position=position,
        digest=cited.digest,
        context=context,
    )
