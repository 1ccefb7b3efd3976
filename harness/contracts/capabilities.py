"""Capability types, and providers' cards: what they declare in twelve fields (R57), how they are supervised."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, UnsetType

from harness.contracts import values
from harness.contracts.ids import ProviderId, ResourceId
from harness.contracts.reasons import Reason, because

Capability = Annotated[str, msgspec.Meta(pattern=r"^[a-z][a-z0-9_]{0,40}(\.[a-z][a-z0-9_]{0,40})?$")]
"""The name of a declared capability type: shipped ones are one word, those of a site are `vendor.name`."""
Risk = Literal["low", "medium", "high"]


class Parameter(values.Value):
    """One parameter a provider takes: its type and, for numbers, its unit and bounds."""

    name: values.Name
    type: Literal["number", "string", "point", "points", "boolean", "digests", "frame"]
    required: bool = True
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None


class Latency(values.Value):
    """Expected duration: a constant part and a part per metre of route, seconds."""

    base_s: values.NonNegative
    per_metre_s: values.NonNegative = 0.0


class CancelBehaviour(values.Value):
    """How a stop ends: `acknowledged` providers report `cancelled` only once they stand still."""

    acknowledged: bool
    within_s: values.Positive


class Estimates(values.Value):
    """The provider's own priors for routing, each in [0, 1] (D23), and its cost in any unit."""

    success: values.Share
    risk: values.Share
    uncertainty: values.Share
    cost: values.NonNegative


class CapabilityCard(values.Value):
    """The twelve fields of the paper, the capability they serve, and supervision facts (D12, D13).

    `protocol` is the version of the provider protocol that the provider speaks, such as 1.1; absent means 1.0.
    """

    provider_id: ProviderId
    version: values.Name
    embodiments: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    preconditions: tuple[str, ...]
    side_effects: tuple[str, ...]
    latency: Latency
    resources: tuple[ResourceId, ...]
    cancel: CancelBehaviour
    risk: Risk
    failure_words: tuple[str, ...]
    evidence: tuple[str, ...]
    capability: Capability
    estimates: Estimates
    moves: bool
    sources: tuple[str, ...] = ()
    reattach: Literal["by_request", "by_handle", "none"] = "by_request"
    resumable: bool = False
    software: str = ""
    protocol: Annotated[str, msgspec.Meta(pattern=r"^\d{1,4}\.\d{1,4}$")] | UnsetType = UNSET


RISKS: tuple[Risk, ...] = ("low", "medium", "high")


class CapabilityType(values.Value):
    """A declared capability: what a stage may ask of its providers, and what they must bring (D54).

    `effects` are the predicates that its providers may claim, `evidence` what their cards must promise, `resources`
    what they must lease, `risk` the least that a stage with it is judged as. A provider of a type that `estimates` is
    asked to score candidate targets before a stage is planned: no stage names it, and nothing rests on its answer.
    """

    name: Capability
    title: values.Name
    parameters: tuple[Parameter, ...] = ()
    resources: tuple[ResourceId, ...] = ()
    effects: tuple[values.Name, ...] = ()
    evidence: tuple[values.Name, ...] = ()
    risk: Risk = "low"
    estimates: bool = False


@dataclass(frozen=True)
class Vocabulary:
    """The capability types that are declared at a site: those that ship, and its own."""

    types: tuple[CapabilityType, ...]

    @cached_property
    def _by_name(self) -> dict[str, CapabilityType]:
        return {one.name: one for one in self.types}

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._by_name)

    def of(self, name: str) -> CapabilityType | None:
        """The declaration of this name; None where there is none."""
        return self._by_name.get(name)

    def estimates(self, card: CapabilityCard) -> bool:
        """Whether the provider only scores candidate targets."""
        found = self.of(card.capability)
        return found is not None and found.estimates

    def refusal(self, card: CapabilityCard) -> Reason | None:
        """Why a provider with this card is not used: its capability is not declared, or the card is of another type."""
        found = self.of(card.capability)
        if found is None:
            return because(
                "capability_of_card_undeclared",
                provider_id=card.provider_id,
                capability=card.capability,
                known=self.names,
            )
        return next(_differences(card, found), None)


NOTHING_DECLARED = Vocabulary(())
"""Without a vocabulary no contract is compiled and no provider used."""


def _differences(card: CapabilityCard, declared: CapabilityType) -> Iterator[Reason]:
    own = {one.name: one for one in declared.parameters}
    for one in card.parameters:
        known = own.get(one.name)
        if known is None and one.required:
            yield _differs(card, because("parameter_not_declared", name=one.name))
        elif known is not None and (known.type != one.type or one.unit not in ("", known.unit)):
            yield _differs(card, because("parameter_of_other_type", name=one.name))
    taken = {one.name for one in card.parameters}
    yield from (
        _differs(card, because("card_lacks_parameter", name=name))
        for name, one in own.items()
        if one.required and name not in taken
    )
    yield from (
        _differs(card, because("resource_not_leased", name=one))
        for one in declared.resources
        if one not in card.resources
    )
    yield from (
        _differs(card, because("evidence_not_promised", name=one))
        for one in declared.evidence
        if one not in card.evidence
    )
    if declared.estimates and card.moves:
        yield _differs(card, because("estimator_moves", name=card.provider_id))


def _differs(card: CapabilityCard, why: Reason) -> Reason:
    return because("card_of_other_type", provider_id=card.provider_id, capability=card.capability, why=why)
