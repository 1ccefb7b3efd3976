"""Computes the history penalty h from verified outcomes alone, never from a provider's own report (R60, D23). Pure."""

from collections.abc import Iterable, Iterator

from harness.contracts.capabilities import Capability
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.values import Share, Value
from harness.contracts.verdicts import Verdict

SILENT: tuple[Verdict, ...] = ("ambiguous", "stale")
"""Verdicts that say nothing about the effect."""


class ExecutionOutcome(Value):
    """One judged execution. `residual` is the transition residual: expected against observed effect, 0 to 1."""

    provider_id: ProviderId
    capability: Capability
    place: str
    configuration: Digest
    verdict: Verdict
    residual: Share = 0.0


class ExecutionResult(Value, array_like=True):
    """The result of one execution of a series."""

    verdict: Verdict
    residual: Share = 0.0


class OutcomeSeries(Value):
    """The judged executions of one provider in one setting, oldest first.

    Two hundred of them are stored with every dispatch, so the setting is stored once.
    """

    provider_id: ProviderId
    capability: Capability
    place: str
    configuration: Digest
    judged: tuple[ExecutionResult, ...]


class RoutingHistory(Value):
    """Judged executions, oldest first: one series for each setting. `outcomes`, one by one, come from older logs."""

    series: tuple[OutcomeSeries, ...] = ()
    outcomes: tuple[ExecutionOutcome, ...] = ()

    def penalty(
        self, provider_id: ProviderId, *, capability: Capability, place: str, configuration: Digest, half_life: float
    ) -> float:
        """Decayed share of failure in [0, 1] with a Beta(1, 1) prior: 0.5 where nothing is known.

        An outcome counts half as much after `half_life` newer ones. Violated and unsafe count 1, satisfied counts
        its residual; ambiguous and stale do not count, since they do not show the effect.
        """
        failed, weight, total = 1.0, 1.0, 2.0
        fading = 0.5 ** (1.0 / half_life)
        for one in self._newest_first((provider_id, capability, place, configuration)):
            if one.verdict in SILENT:
                continue
            failed += weight * (one.residual if one.verdict == "satisfied" else 1.0)
            total += weight
            weight *= fading
        return failed / total

    def _newest_first(
        self, setting: tuple[ProviderId, Capability, str, Digest]
    ) -> Iterator[ExecutionResult | ExecutionOutcome]:
        for held in reversed(self.series):
            if _setting(held) == setting:
                yield from reversed(held.judged)
        yield from (one for one in reversed(self.outcomes) if _setting(one) == setting)


def judged(outcomes: Iterable[tuple[Verdict, float]]) -> tuple[ExecutionResult, ...]:
    """A series' executions from (verdict, residual), oldest first."""
    return tuple([ExecutionResult(verdict=verdict, residual=residual) for verdict, residual in outcomes])


def _setting(one: OutcomeSeries | ExecutionOutcome) -> tuple[ProviderId, Capability, str, Digest]:
    return (one.provider_id, one.capability, one.place, one.configuration)
