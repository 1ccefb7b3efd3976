"""Capability cards: what a provider declares it can do, in twelve fields (R57), and how it may be supervised."""

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, UnsetType

from harness.contracts import values
from harness.contracts.ids import ProviderId, ResourceId

Capability = Literal[
    "take_request", "navigate", "capture_panorama", "observe", "analyse_passage", "deliver_message", "speak",
    "keep_evidence", "describe_image",
]  # fmt: skip
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
