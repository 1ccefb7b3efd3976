"""/providers: who can act, with the provider's card, the result of the conformance kit, and its record in the log."""

from collections.abc import Sequence

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.background.conformance_claims import claimed
from app.console import ActorDep, ConsoleDep
from app.views.providers import providers_page
from app.web.rendering import render
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import ProviderId
from harness.contracts.memory import KnownCard, MemoryQuery, MemoryRecord
from harness.memory.fabric import MemoryFabric

router = APIRouter(prefix="/providers")
COUNTED = 10_000


@router.get("")
def index(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    """The cards of the robots that run here, and those of memory for everybody else who ever acted."""
    cards = {card.provider_id: card for card in (*cards_in_memory(console.runtime.memory), *console.cards())}.values()
    claims = {card.provider_id: claimed(card.provider_id) for card in cards}
    history: dict[ProviderId, Sequence[MemoryRecord]] = {
        card.provider_id: [
            one.record
            for one in console.runtime.memory.find(
                MemoryQuery(kinds=("outcome",), provider_id=card.provider_id, limit=COUNTED)
            )
        ]
        for card in cards
    }
    page = providers_page(
        console.shell("Providers", "providers", actor),
        tuple(cards),
        conformance={name: claim for name, claim in claims.items() if claim is not None},
        outcomes=history,
        predicates=console.runtime.predicates,
        vouched=console.runtime.site.vouched,
    )
    return render("providers/index.html", page)


def cards_in_memory(memory: MemoryFabric) -> tuple[CapabilityCard, ...]:
    """Cards that roles were shown, the newest of each provider."""
    known = [one.record.knowledge for one in memory.find(MemoryQuery(kinds=("card",), limit=COUNTED))]
    newest: dict[str, CapabilityCard] = {}
    for record in known:
        if isinstance(record, KnownCard):
            newest.setdefault(record.card.provider_id, record.card)
    return tuple(newest.values())
