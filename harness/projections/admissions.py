"""Folds the checks of one robot: which of its providers may be used, with which card, at which address. Pure."""

import msgspec
from msgspec.structs import replace

from harness.contracts.actors import Actor
from harness.contracts.admissions import CheckedProvider, RobotChecked
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Count, Value, digest


class Admission(Value):
    """The newest check of one provider."""

    provider: CheckedProvider
    address: str
    result: Digest
    actor: Actor
    at_s: float


class Admissions(Value):
    """The fold of one robot's checks."""

    version: Count = 0
    providers: dict[ProviderId, Admission] = msgspec.field(default_factory=dict)

    def refusal(self, card: CapabilityCard, *, address: str) -> Reason | None:
        """Why a provider with this card at this address is not used; None where it is admitted."""
        known = self.providers.get(card.provider_id)
        if known is None:
            return because("provider_not_checked", provider_id=card.provider_id)
        if known.address != address:
            return because("provider_checked_elsewhere", provider_id=card.provider_id, address=known.address)
        if known.provider.card != digest(card):
            return because(
                "provider_card_changed",
                provider_id=card.provider_id,
                version=known.provider.version,
                now=card.version,
            )
        if not known.provider.ok:
            return because("provider_check_failed", provider_id=card.provider_id, rows=known.provider.not_met)
        return None


def apply(admissions: Admissions, event: RobotChecked) -> Admissions:
    """The admissions after one more check: it replaces what was known of the providers that it tried."""
    found = {
        one.provider_id: Admission(
            provider=one, address=event.address, result=event.result, actor=event.actor, at_s=event.at_s
        )
        for one in event.checked
    }
    return replace(admissions, version=admissions.version + 1, providers=admissions.providers | found)
