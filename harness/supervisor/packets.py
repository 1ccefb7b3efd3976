"""Builds evidence packets; what the harness measured and what the provider declared stay separate (R93)."""

from collections.abc import Sequence

from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from harness.contracts.events import DispatchIntended
from harness.contracts.evidence import EvidencePacket, EvidenceReference, PacketIdentity
from harness.contracts.ids import packet_id
from harness.contracts.observations import AnySample
from harness.contracts.protocol import InvocationReport
from harness.contracts.reasons import Explanation
from harness.projections.mission import Invocation, Mission
from harness.supervisor.observations import ObservationBuffer


def build_packet(
    mission: Mission,
    invocation: Invocation,
    *,
    report: InvocationReport,
    samples: Sequence[AnySample],
    observations: ObservationBuffer,
    collected_s: float,
    protocol: str,
    images: Sequence[EvidenceReference] = (),
    measured: Sequence[EvidenceReference] = (),
    starts: int | UnsetType = UNSET,
) -> EvidencePacket:
    """Z = (I, k_ctx, O_before, O_after, P, proposed facts). Identity and proposals are the provider's own, never ours.

    `protocol` is the version of the provider protocol that the provider speaks. `images` are those among the samples,
    `measured` is what independent
    sources found, `starts` how many starts of the request the robot's own journal holds.
    """
    intent = invocation.intent
    estimates: tuple[EvidenceReference, ...] = ()
    after: tuple[EvidenceReference, ...] = ()
    if samples:
        trajectory, _ = observations.seal(samples, source="robot")
        tail, _ = observations.seal([s for s in samples if s.at_s >= report.at_s - 1.0], source="robot")
        estimates, after = (trajectory,), (replace(tail, kind="after"),)
    return EvidencePacket(
        identity=PacketIdentity(
            mission_id=report.identity.mission_id,
            node_id=report.identity.node_id,
            attempt=report.identity.attempt,
            request_id=report.identity.request_id,
            invocation_id=intent.invocation_id,
            packet_id=packet_id(intent.invocation_id),
            provider_id=report.identity.provider_id,
            provider_version=intent.provider_version,
        ),
        k_ctx=intent.k_ctx,
        configuration=mission.configuration,
        dispatched_s=intent.dispatched_s,
        terminal_s=report.at_s,
        collected_s=collected_s,
        terminal=report.status,
        failure=_failure_word(invocation, report),
        declared=report.declared,
        before=intent.before,
        after=(*images, *after, *measured, *_attested(mission, intent)),
        estimates=estimates,
        proposed=report.proposed_facts,
        receipts=report.receipts,
        cites=intent.cites,
        verify_only=intent.verify_only,
        protocol=protocol,
        begun=starts,
    )


def _attested(mission: Mission, intent: DispatchIntended) -> tuple[EvidenceReference, ...]:
    """A person's attestation, in the one look that it opened (D17)."""
    attestation = mission.of(intent.node_id).attested
    return tuple(one for one in attestation if intent.handoff_id and one.values.get("handoff_id") == intent.handoff_id)


def _failure_word(invocation: Invocation, report: InvocationReport) -> str:
    """A stop that the supervisor requested because of a deadline is a timeout, whatever the provider calls it."""
    if report.status == "cancelled" and _failure_behind(invocation.stop_requested) == "timeout":
        return "timeout"
    return report.failure


def _failure_behind(stop: Explanation) -> str:
    """The failure for which the supervisor stopped it; an older release wrote it before a colon."""
    if isinstance(stop, str):
        return stop.partition(":")[0]
    return str(stop.facts.get("failure", "")) if stop.code == "stopped_for_failure" else ""
