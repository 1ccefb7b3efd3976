"""Pure: who can act: every provider's card in its twelve fields, what the kit says of it, and what its log says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.views.shell import Shell
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import ProviderId
from harness.contracts.memory import MemoryRecord, ProviderOutcome


@dataclass(frozen=True)
class Conformance:
    """What the provider's conformance file claims; empty where none ships. A claim, until the kit is run."""

    meets: tuple[str, ...]
    exempt: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class OutcomeCount:
    """How many executions ended with one verdict of the verifier."""

    verdict: str
    count: int


@dataclass(frozen=True)
class ProviderCard:
    """One provider. `fields` are the card's, in the paper's order: the provider's own word."""

    provider_id: str
    version: str
    capability: str
    risk: str
    moves: bool
    fields: tuple[tuple[str, str], ...]
    supervision: tuple[tuple[str, str], ...]
    conformance: Conformance | None
    outcomes: tuple[OutcomeCount, ...]
    executions: int
    mean_residual: float | None
    newest_mission: str


@dataclass(frozen=True)
class ProvidersPage:
    """All providers, by capability."""

    shell: Shell
    cards: tuple[ProviderCard, ...]


def providers_page(
    shell: Shell,
    cards: Sequence[CapabilityCard],
    *,
    conformance: Mapping[ProviderId, Conformance],
    outcomes: Mapping[ProviderId, Sequence[MemoryRecord]],
) -> ProvidersPage:
    """`outcomes`: what memory verified of each provider, newest first."""
    rows = [_card(one, conformance.get(one.provider_id), outcomes.get(one.provider_id, ())) for one in cards]
    return ProvidersPage(shell=shell, cards=tuple(sorted(rows, key=lambda one: (one.capability, one.provider_id))))


def _card(card: CapabilityCard, claims: Conformance | None, records: Sequence[MemoryRecord]) -> ProviderCard:
    ended = [record.knowledge for record in records if isinstance(record.knowledge, ProviderOutcome)]
    verdicts = sorted({one.verdict for one in ended})
    return ProviderCard(
        provider_id=card.provider_id,
        version=card.version,
        capability=card.capability.replace("_", " "),
        risk=card.risk,
        moves=card.moves,
        fields=_fields(card),
        supervision=(
            ("moves the body", "yes" if card.moves else "no"),
            ("after a restart", f"{card.reattach.replace('_', ' ')}{', resumable' if card.resumable else ''}"),
            ("sources of its evidence", ", ".join(card.sources) or "none named"),
            ("software", card.software or "not named"),
        ),
        conformance=claims,
        outcomes=tuple(OutcomeCount(name, sum(one.verdict == name for one in ended)) for name in verdicts),
        executions=len(ended),
        mean_residual=sum(one.residual for one in ended) / len(ended) if ended else None,
        newest_mission=records[0].provenance.mission_id if records else "",
    )


def _fields(card: CapabilityCard) -> tuple[tuple[str, str], ...]:
    """The twelve fields of the paper (R57)."""
    latency, estimates = card.latency, card.estimates
    stop = "acknowledged" if card.cancel.acknowledged else "not acknowledged"
    return (
        ("provider and version", f"{card.provider_id} {card.version}"),
        ("embodiments", ", ".join(card.embodiments) or "any"),
        ("parameters", ", ".join(_parameter(one.name, one.unit, required=one.required) for one in card.parameters)),
        ("preconditions", ", ".join(card.preconditions) or "none"),
        ("side effects", ", ".join(card.side_effects) or "none"),
        ("expected latency", f"{latency.base_s:g} s and {latency.per_metre_s:g} s per metre"),
        ("resources", ", ".join(card.resources) or "none"),
        ("cancel", f"{stop} within {card.cancel.within_s:g} s"),
        ("risk", card.risk),
        ("failure words", ", ".join(card.failure_words) or "none"),
        ("evidence it promises", ", ".join(card.evidence) or "none"),
        (
            "its own estimates",
            f"success {estimates.success:g}, risk {estimates.risk:g}, "
            f"uncertainty {estimates.uncertainty:g}, cost {estimates.cost:g}",
        ),
    )


def _parameter(name: str, unit: str, *, required: bool) -> str:
    return f"{name}{f' in {unit}' if unit else ''}{'' if required else ' (optional)'}"
