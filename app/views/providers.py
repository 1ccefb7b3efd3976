"""Shapes the providers: the twelve fields of each card, the conformance result, and the record in the log."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, reasoned, word
from app.views.shell import Shell
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import ProviderId
from harness.contracts.memory import MemoryRecord, ProviderOutcome
from harness.contracts.ports import Predicates
from harness.contracts.predicates import NO_PREDICATES, InstalledPredicate


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
    """One provider: its card, what its conformance file claims, and its verified outcomes, newest first."""

    card: CapabilityCard
    conformance: Conformance | None
    ended: tuple[ProviderOutcome, ...]
    newest_mission: str

    @property
    def outcomes(self) -> tuple[OutcomeCount, ...]:
        counted = Counter(one.verdict for one in self.ended)
        return tuple(OutcomeCount(verdict, count) for verdict, count in sorted(counted.items()))

    @property
    def mean_residual(self) -> float:
        """The mean gap between expected and observed effect, 0 to 1."""
        return sum(one.residual for one in self.ended) / max(len(self.ended), 1)


@dataclass(frozen=True)
class PredicateRow:
    """A predicate of an installed package; `vouched`: the site lets it decide."""

    installed: InstalledPredicate
    vouched: bool


@dataclass(frozen=True)
class ProvidersPage:
    """All providers, by capability, and the predicates of installed packages; `unusable`: why others are not used."""

    shell: Shell
    cards: tuple[ProviderCard, ...]
    predicates: tuple[PredicateRow, ...]
    unusable: tuple[str, ...]


def providers_page(
    shell: Shell,
    cards: Sequence[CapabilityCard],
    *,
    conformance: Mapping[ProviderId, Conformance],
    outcomes: Mapping[ProviderId, Sequence[MemoryRecord]],
    predicates: Predicates = NO_PREDICATES,
    vouched: Sequence[str] = (),
) -> ProvidersPage:
    """`outcomes`: what memory verified of each provider, newest first. `vouched` is what the site vouches for."""
    rows = [_card(one, conformance.get(one.provider_id), outcomes.get(one.provider_id, ())) for one in cards]
    return ProvidersPage(
        shell=shell,
        cards=tuple(sorted(rows, key=lambda one: (word(one.card.capability), one.card.provider_id))),
        predicates=tuple(PredicateRow(one, one.name in vouched) for one in predicates.installed.values()),
        unusable=tuple(reasoned(one.reason) for one in predicates.problems),
    )


def _card(card: CapabilityCard, claims: Conformance | None, records: Sequence[MemoryRecord]) -> ProviderCard:
    return ProviderCard(
        card=card,
        conformance=claims,
        ended=tuple(one.knowledge for one in records if isinstance(one.knowledge, ProviderOutcome)),
        newest_mission=records[0].provenance.mission_id if records else "",
    )


def supervision(card: CapabilityCard) -> tuple[tuple[str, str], ...]:
    """What the harness asks of a card beside the paper's fields."""
    return (
        (N_("moves the body"), "yes" if card.moves else "no"),
        (N_("after a restart"), listed((word(card.reattach), "resumable")) if card.resumable else word(card.reattach)),
        (N_("sources of its evidence"), listed(map(word, card.sources)) or N_("none named")),
        ("software", card.software or N_("not named")),
    )


def card_fields(card: CapabilityCard) -> tuple[tuple[str, str], ...]:
    """The twelve fields of the paper (R57)."""
    latency, estimates = card.latency, card.estimates
    return (
        (N_("provider and version"), f"{card.provider_id} {card.version}"),
        ("embodiments", listed(card.embodiments) or "any"),
        ("parameters", listed(_parameter(one.name, one.unit, required=one.required) for one in card.parameters)),
        ("preconditions", listed(card.preconditions) or "none"),
        (N_("side effects"), listed(card.side_effects) or "none"),
        (N_("expected latency"), _latency(latency.base_s, latency.per_metre_s)),
        ("resources", listed(card.resources) or "none"),
        ("cancel", _stopping(card)),
        ("risk", card.risk),
        (N_("failure words"), listed(map(word, card.failure_words)) or "none"),
        (N_("evidence it promises"), listed(map(word, card.evidence)) or "none"),
        (
            N_("its own estimates"),
            lazy_gettext(
                "success {success}, risk {risk}, uncertainty {uncertainty}, cost {cost}",
                success=f"{estimates.success:g}",
                risk=f"{estimates.risk:g}",
                uncertainty=f"{estimates.uncertainty:g}",
                cost=f"{estimates.cost:g}",
            ),
        ),
    )


def _parameter(name: str, unit: str, *, required: bool) -> str:
    label = lazy_gettext("{name} in {unit}", name=name, unit=unit) if unit else name
    return label if required else lazy_gettext("{name} (optional)", name=label)


def _latency(base_s: float, per_metre_s: float) -> str:
    return lazy_gettext("{base} s and {more} s per metre", base=f"{base_s:g}", more=f"{per_metre_s:g}")


def _stopping(card: CapabilityCard) -> str:
    within = f"{card.cancel.within_s:g}"
    if card.cancel.acknowledged:
        return lazy_gettext("acknowledged within {seconds} s", seconds=within)
    return lazy_gettext("not acknowledged within {seconds} s", seconds=within)
