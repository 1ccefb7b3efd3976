"""Provides a provider that passes every call on and may show another card: the base of fakes that break one thing."""

from msgspec.structs import replace

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ports import Provider
from harness.provider_protocol.delegation import DelegatingProvider


class Passing(DelegatingProvider):
    """The Provider port over another provider; `card` fields may be changed."""

    def __init__(self, inner: Provider, **card: object) -> None:
        super().__init__(inner)
        self._card = replace(inner.card, **card)

    @property
    def card(self) -> CapabilityCard:
        return self._card
