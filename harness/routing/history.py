"""Pure: the history penalty h, from verified outcomes alone; a provider's own word never enters (R60, D23)."""

from harness.contracts.capabilities import Capability
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.values import Share, Value
from harness.contracts.verdicts import Verdict


class Outcome(Value):
    """One judged execution. `residual` is the transition residual: expected against observed effect, 0 to 1."""

    provider_id: ProviderId
    capability: Capability
    place: str
    configuration: Digest
    verdict: Verdict
    residual: Share = 0.0


class History(Value):
    """Judged executions, oldest first."""

    outcomes: tuple[Outcome, ...] = ()

    def penalty(
        self, provider_id: ProviderId, *, capability: Capability, place: str, configuration: Digest, half_life: float
    ) -> float:
        """Decayed share of failure in [0, 1] with a Beta(1, 1) prior: 0.5 where nothing is known.

        An outcome counts half as much after `half_life` newer ones. Violated and unsafe count 1, satisfied counts
        its residual; ambiguous and stale say nothing about the effect and do not count.
        """
        failed, weight, total = 1.0, 1.0, 2.0
        for outcome in reversed(self.outcomes):
            about = (outcome.provider_id, outcome.capability, outcome.place, outcome.configuration)
            if about != (provider_id, capability, place, configuration) or outcome.verdict in ("ambiguous", "stale"):
                continue
            failed += weight * (outcome.residual if outcome.verdict == "satisfied" else 1.0)
            total += weight
            weight *= 0.5 ** (1.0 / half_life)
        return failed / total
