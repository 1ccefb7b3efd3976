"""Selects the records a role may see: filters first, each with its reason, then the item budget (D22). Pure."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import msgspec
from msgspec.structs import replace

from harness.contexts.conflicts import Statement, conflicting, superseded
from harness.contexts.view import StateView
from harness.contracts.contexts import Context, ContextRecord, Role, Withheld
from harness.contracts.errors import ContextOverflow
from harness.contracts.ids import NodeId
from harness.contracts.reasons import Reason, because

PROVIDER_KINDS = ("declared", "receipts")
EARLY_S = 1e-6


class SelectionItem(msgspec.Struct, frozen=True):
    """A candidate record for a role's context.

    `scope`: the nodes it is about; empty = the whole mission. `speaks_at_s` and `limit_s`: its age counts at that
    instant and may not exceed the limit; without them it does not age. `states`: named values it asserts, compared
    with those of other sources. `subject`: what it is about; a newer record of the same source and subject takes its
    place. `barred`: already known to be unfit, with the reason.
    """

    record: ContextRecord
    scope: frozenset[NodeId] = frozenset()
    speaks_at_s: float | None = None
    limit_s: float | None = None
    states: Mapping[str, float | str] = msgspec.field(default_factory=dict)
    subject: str = ""
    barred: Withheld | None = None


@dataclass(frozen=True)
class Selection:
    """What a role requests from the compiler."""

    role: Role
    node_id: NodeId | None
    budget: int
    minimum_confidence: float
    nodes: frozenset[NodeId] | None = None


def compile_context(view: StateView, items: Iterable[SelectionItem], *, selection: Selection) -> Context:
    """One role's view of one state version. Raises ContextOverflow if the mandatory records exceed the budget."""
    selected: list[SelectionItem] = []
    withheld: list[Withheld] = []
    for item in items:
        refusal = _refusal(item, selection)
        if refusal is None:
            selected.append(item)
        else:
            withheld.append(refusal)
    selected, contradicted = _without_contradictions(selected)
    withheld.extend(contradicted)
    selected, dropped = _within_budget(selected, selection)
    withheld.extend(dropped)
    return Context(
        role=selection.role,
        mission_id=view.mission.mission_id,
        node_id=selection.node_id,
        k=view.mission.k,
        at_s=view.at_s,
        configuration=view.mission.configuration,
        records=tuple(item.record for item in selected),
        withheld=tuple(withheld),
    )


def withhold(record: ContextRecord, reason: str, detail: Reason) -> Withheld:
    """The trace of a record that was left out."""
    return Withheld(kind=record.kind, source=record.source, reason=reason, detail=detail)  # type: ignore[arg-type]


def budgeted(items: Iterable[SelectionItem], *, limit: int) -> list[SelectionItem]:
    """At most `limit` items, the newest; the others are barred by the budget of their kind."""
    ranked = sorted(items, key=lambda item: -item.record.at_s)
    return [
        item
        if place < limit
        else replace(item, barred=withhold(item.record, "budget", because("beyond_limit_of_kind", limit=limit)))
        for place, item in enumerate(ranked)
    ]


def _refusal(item: SelectionItem, selection: Selection) -> Withheld | None:
    record = item.record
    if item.barred is not None:
        return item.barred
    if item.scope and selection.nodes is not None and not item.scope & selection.nodes:
        return withhold(record, "scope", because("about_other_stages", stages=tuple(sorted(item.scope))))
    if selection.role == "verifier" and not _admissible_evidence(record):
        return withhold(record, "origin", because("origin_no_evidence", origin=record.origin))
    if record.confidence < selection.minimum_confidence:
        return withhold(
            record,
            "low_confidence",
            because("confidence_too_low", confidence=record.confidence, least=selection.minimum_confidence),
        )
    return _aged(item)


def _admissible_evidence(record: ContextRecord) -> bool:
    """R73: the verifier never reads a planner's conclusion, and of a provider only its structured numbers."""
    return record.origin != "planner" and (record.origin != "provider" or record.kind in PROVIDER_KINDS)


def _aged(item: SelectionItem) -> Withheld | None:
    if item.speaks_at_s is None or item.limit_s is None:
        return None
    age_s = item.speaks_at_s - item.record.at_s
    if age_s < -EARLY_S:
        return withhold(item.record, "scope", because("observed_too_late", late_s=-age_s))
    if age_s <= item.limit_s:
        return None
    return withhold(item.record, "stale", because("record_too_old", age_s=age_s, limit_s=item.limit_s))


def _without_contradictions(items: list[SelectionItem]) -> tuple[list[SelectionItem], list[Withheld]]:
    statements = [
        Statement(
            source=item.record.source,
            at_s=item.record.at_s,
            human=item.record.origin == "human",
            subject=item.subject,
            states=item.states,
        )
        for item in items
    ]
    old = superseded(statements)
    torn = conflicting(statements, ignored=frozenset(old))
    withheld = [withhold(items[index].record, "superseded", why) for index, why in old.items()]
    withheld += [withhold(items[index].record, "conflict", why) for index, why in torn.items()]
    return [item for index, item in enumerate(items) if index not in old and index not in torn], withheld


def _within_budget(items: list[SelectionItem], selection: Selection) -> tuple[list[SelectionItem], list[Withheld]]:
    mandatory = [item for item in items if item.record.mandatory]
    if len(mandatory) > selection.budget:
        raise ContextOverflow(
            because("context_overflow", records=len(mandatory), role=selection.role, budget=selection.budget),
            where=because(
                "at_context",
                subject=selection.node_id or because("the_goal"),
                kinds=tuple(item.record.kind for item in mandatory),
            ),
        )
    excess = len(items) - selection.budget
    optional = sorted((item for item in items if not item.record.mandatory), key=lambda item: item.record.at_s)
    dropped = optional[:excess] if excess > 0 else []
    withheld = [withhold(item.record, "budget", because("beyond_budget", budget=selection.budget)) for item in dropped]
    return [item for item in items if not any(item is one for one in dropped)], withheld
