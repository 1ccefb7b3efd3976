"""Computes the history penalty h from verified outcomes alone, never from a provider's own report (R60, D23). Pure."""

from collections.abc import Iterator

from harness.contracts.capabilities import Capability
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.memory import SILENT, OutcomeSums
from harness.contracts.values import Count, Share, Value
from harness.contracts.verdicts import Verdict


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
    """The judged executions of one provider in one setting, oldest first, as earlier logs store them."""

    provider_id: ProviderId
    capability: Capability
    place: str
    configuration: Digest
    judged: tuple[ExecutionResult, ...]


class SettingHistory(Value):
    """What one provider achieved in one setting, as decayed sums over all that the log held up to `position`."""

    provider_id: ProviderId
    capability: Capability
    place: str
    configuration: Digest
    sums: OutcomeSums
    position: Count


class RoutingHistory(Value):
    """Decayed sums for each setting. In older logs the executions themselves: one series for each setting, oldest
    first, or `outcomes` one by one."""

    settings: tuple[SettingHistory, ...] = ()
    series: tuple[OutcomeSeries, ...] = ()
    outcomes: tuple[ExecutionOutcome, ...] = ()

    def penalty(
        self, provider_id: ProviderId, *, capability: Capability, place: str, configuration: Digest, half_life: float
    ) -> float:
        """Decayed share of failure in [0, 1] with a Beta(1, 1) prior: 0.5 where nothing is known."""
        setting = (provider_id, capability, place, configuration)
        for known in self.settings:
            if _setting(known) == setting:
                return (1.0 + known.sums.failed) / (2.0 + known.sums.weight)
        failed, weight, total = 1.0, 1.0, 2.0
        fading = 0.5 ** (1.0 / half_life)
        for one in self._newest_first(setting):
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


def _setting(one: SettingHistory | OutcomeSeries | ExecutionOutcome) -> tuple[ProviderId, Capability, str, Digest]:
    return (one.provider_id, one.capability, one.place, one.configuration)
