"""Converts a verified outcome to the record of kind "example" that the skill role is shown in C2. Pure."""

from harness.contracts.contexts import ContextRecord
from harness.contracts.ids import PacketId
from harness.contracts.memory import MemoryRecord, ProviderOutcome
from harness.contracts.protocol import Parameters
from harness.contracts.values import Count, Share, Value, raw
from harness.contracts.verdicts import Verdict


class Example(Value):
    """What was asked of the provider and what it truly achieved; `position` and `packet_id` lead to the evidence."""

    record_id: str
    position: Count
    packet_id: PacketId | None
    provider_version: str
    place: str
    parameters: Parameters
    verdict: Verdict
    residual: Share
    duration_s: float
    measured: dict[str, float]


def as_example(record: MemoryRecord, outcome: ProviderOutcome) -> ContextRecord:
    """The outcome as a record of the harness's own history, at the instant at which it was judged."""
    example = Example(
        record_id=record.record_id,
        position=record.provenance.position,
        packet_id=record.provenance.packet_id,
        provider_version=outcome.provider_version,
        place=outcome.place,
        parameters=outcome.parameters,
        verdict=outcome.verdict,
        residual=outcome.residual,
        duration_s=outcome.duration_s,
        measured=outcome.measured,
    )
    return ContextRecord(
        kind="example",
        origin="verifier",
        source=record.record_id,
        at_s=record.valid_from_s,
        value=raw(example),
        confidence=record.confidence,
    )
