"""Derives semantic memory: capability contracts as shown to skill roles, and rules of missions (R140). Pure."""

from collections.abc import Callable, Iterator

import msgspec

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.events import ContractCompiled, ContractRecompiled, DispatchIntended
from harness.contracts.ids import Digest
from harness.contracts.memory import KnownCard, KnownRules
from harness.memory.draft import MemoryDraft, MissionStep, configured, provenance

ReadRecord = Callable[[Digest], bytes | None]
"""The body of a decision's stored artefact, from the log; None if it was not stored."""


class _Item(msgspec.Struct, frozen=True):
    kind: str
    value: msgspec.Raw


class _ContextPart(msgspec.Struct, frozen=True):
    """As much of a stored context as is read here."""

    records: tuple[_Item, ...]


_shown = msgspec.json.Decoder(_ContextPart)
_card = msgspec.json.Decoder(CapabilityCard)


def semantic(step: MissionStep, *, read: ReadRecord) -> Iterator[MemoryDraft]:
    """What one event adds to semantic memory."""
    match step.event:
        case ContractCompiled() | ContractRecompiled() as event:
            pinned = event.configuration if isinstance(event, ContractRecompiled) else step.before.configuration
            rules = KnownRules(
                configuration=pinned,
                template=event.contract.template,
                recovery=event.policy,
                constraints=event.contract.constraints,
            )
            subject = f"rules/{event.contract.template}/{pinned[:16]}"
            yield configured(step, role="semantic", subject=subject, knowledge=rules)
        case DispatchIntended() as event:
            card = shown_card(read(event.context))
            if card is not None:
                yield MemoryDraft(
                    role="semantic",
                    subject=f"card/{card.provider_id}",
                    knowledge=KnownCard(card=card),
                    verification="configured",
                    provenance=provenance(step, sources=(card.provider_id,), node_id=event.node_id),
                    valid_from_s=event.dispatched_s,
                )
        case _:
            return


def shown_card(context: bytes | None) -> CapabilityCard | None:
    """The card in a stored C2 context; None if there is none."""
    if context is None:
        return None
    items = _shown.decode(context).records
    return next((_card.decode(item.value) for item in items if item.kind == "card"), None)
