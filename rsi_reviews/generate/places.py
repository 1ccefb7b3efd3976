"""Compares the success of providers by place, and proposes how much weight routing should give to history. Pure."""

from collections import defaultdict
from collections.abc import Iterator

from harness.contracts.configuration import Configuration
from harness.contracts.ids import ProviderId
from harness.contracts.values import Value
from rsi_reviews.generate.changes import Positions, ProposedChange, motives, with_weight
from rsi_reviews.generate.ladders import SMALLEST_EFFECT
from rsi_reviews.generate.trace import Trace, TracedExecution
from rsi_reviews.restrictions import WEIGHT_CEILING

LEAST = 4
OFTEN = 0.4
SELDOM = 0.25
HEED = 2.5
LEAST_WEIGHT = 1.0


class ProviderRecord(Value):
    """One provider at one place, for one capability: executions by itself, and how many were refuted."""

    provider_id: ProviderId
    worked: int
    failed: int

    @property
    def share(self) -> float:
        """The share that failed, with a Beta(1, 1) prior."""
        return (self.failed + 1) / (self.worked + 2)


def routing_changes(trace: Trace, current: Configuration) -> Iterator[ProposedChange]:
    """More weight on history, where one provider often fails at a place and another one succeeds there."""
    for (capability, place), standings in sorted(_standings(trace).items()):
        worst = max(standings, key=lambda one: (one.share, one.provider_id))
        best = min(standings, key=lambda one: (one.share, one.provider_id))
        heed = min(WEIGHT_CEILING, max(LEAST_WEIGHT, HEED * current.routing.history))
        if worst.worked < LEAST or worst.share < OFTEN or best.share > SELDOM or heed <= current.routing.history:
            continue
        yield ProposedChange(
            section="routing",
            configuration=with_weight(current, history=heed),
            reason=f"At {place or 'no place'}, {worst.provider_id} failed {worst.failed} of {worst.worked} times to "
            f"{capability}, {best.provider_id} {best.failed} of {best.worked} times.",
            intended=f"Routing weighs verified failures at a place by {heed:g} instead of {current.routing.history:g}.",
            metric="recovery_cost",
            smallest_effect=SMALLEST_EFFECT,
            worth=worst.failed / len(trace.missions),
            motives=motives(trace, _refuted(worst.provider_id, place)),
        )


def _standings(trace: Trace) -> dict[tuple[str, str], list[ProviderRecord]]:
    counts: dict[tuple[str, str], dict[ProviderId, list[bool]]] = defaultdict(lambda: defaultdict(list))
    for mission in trace.missions:
        for one in mission.executions:
            if _judged(one):
                counts[(one.capability, one.place)][one.provider_id].append(one.verdict in ("violated", "unsafe"))
    return {
        where: [
            ProviderRecord(provider_id=who, worked=len(outcomes), failed=sum(outcomes))
            for who, outcomes in sorted(found.items())
        ]
        for where, found in counts.items()
        if len(found) > 1
    }


def _judged(one: TracedExecution) -> bool:
    """Whether the verifier decided about the effect; ambiguous and stale say nothing about it (D23)."""
    return not one.verify_only and one.verdict in ("satisfied", "violated", "unsafe")


def _refuted(provider_id: ProviderId, place: str) -> Positions:
    return lambda mission: [
        one.position
        for one in mission.executions
        if one.provider_id == provider_id and one.place == place and one.verdict in ("violated", "unsafe")
    ]
