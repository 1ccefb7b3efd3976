"""Derives episodic and operational memory from the verifier's decisions, never from a provider's report. Pure."""

from collections.abc import Iterator

from harness.contracts.configuration import FailureClass
from harness.contracts.events import CommitRejected, NodeCommitted
from harness.contracts.ids import NodeId
from harness.contracts.memory import AnyKnowledge, Episode, MemoryRole, ProviderOutcome
from harness.contracts.verdicts import NodeVerdict
from harness.memory.draft import MemoryDraft, MissionStep, confidence_of, provenance
from harness.projections.memory import VerifiedAttempt, judgement

DEVIATIONS = ("distance_m", "displacement_m", "turn_rad")
"""Measured names that say how far the observed effect is from the expected one, where a condition bounds them."""
SHORTFALLS = ("progress",)
"""Measured shares of which all was expected; the bound is the least that is accepted."""


def episodic(step: MissionStep) -> Iterator[MemoryDraft]:
    """The attempt, if it was verified: committed, or its effect refuted (R138)."""
    closed = _closed(step)
    if closed is None:
        return
    intent = closed.intent
    node = step.before.node(intent.node_id)
    episode = Episode(
        node_id=intent.node_id,
        subgoal=node.subgoal if node else intent.node_id,
        attempt=intent.attempt,
        invocation_id=intent.invocation_id,
        provider_id=intent.provider_id,
        provider_version=intent.provider_version,
        capability=intent.capability,
        place=step.before.place(intent.node_id),
        configuration=step.before.configuration,
        verdict=closed.verdict.verdict,
        committed=closed.committed,
        duration_s=max(0.0, closed.packet.terminal_s - intent.dispatched_s),
        action=intent.action,
        failure=None if closed.committed else failure_of(closed.verdict),
    )
    yield _draft(
        step, closed, role="episodic", subject=f"attempt/{intent.invocation_id}", knowledge=episode, fresh=True
    )


def operational(step: MissionStep) -> Iterator[MemoryDraft]:
    """What the acting provider achieved (R139). A later look at the same execution replaces the earlier verdict.

    Executions cut short by a person or the supervisor do not count; one that ran out of time does.
    """
    closed = _closed(step)
    if closed is None or (closed.packet.terminal == "cancelled" and closed.packet.failure != "timeout"):
        return
    acting = closed.acting
    ended_s = step.before.terminals.get(acting.invocation_id, closed.packet.terminal_s)
    outcome = ProviderOutcome(
        provider_id=acting.provider_id,
        provider_version=acting.provider_version,
        capability=acting.capability,
        place=step.before.place(acting.node_id),
        configuration=step.before.configuration,
        parameters=acting.parameters,
        verdict=closed.verdict.verdict,
        residual=residual(closed.verdict),
        duration_s=max(0.0, ended_s - acting.dispatched_s),
        measured={name: value for result in closed.verdict.results for name, value in result.measured.items()},
    )
    fresh = not step.before.judged(acting.invocation_id)
    yield _draft(
        step, closed, role="operational", subject=f"outcome/{acting.invocation_id}", knowledge=outcome, fresh=fresh
    )


def residual(verdict: NodeVerdict) -> float:
    """The transition residual: the largest share of its bound by which an observed effect missed the expected one.

    0 where every effect is as expected or none is measured against a bound, 1 at the bound or beyond.
    """
    shares = [0.0]
    for result in verdict.results:
        for name in result.measured.keys() & result.bounds.keys():
            bound, value = result.bounds[name], result.measured[name]
            if name in DEVIATIONS and bound > 0:
                shares.append(value / bound)
            elif name in SHORTFALLS and bound < 1:
                shares.append((1.0 - value) / (1.0 - bound))
    return min(1.0, max(0.0, *shares))


def failure_of(verdict: NodeVerdict) -> FailureClass:
    """The failure class of a refuted effect."""
    return "unsafe_action" if verdict.verdict == "unsafe" else "violated"


def _closed(step: MissionStep) -> VerifiedAttempt | None:
    event = step.event
    return judgement(step.before, event) if isinstance(event, NodeCommitted | CommitRejected) else None


def _draft(
    step: MissionStep, closed: VerifiedAttempt, *, role: MemoryRole, subject: str, knowledge: AnyKnowledge, fresh: bool
) -> MemoryDraft:
    packet, verdict = closed.packet, closed.verdict
    sources = {source for result in verdict.results for source in result.sources}
    blobs = [one.blob for one in (*packet.before, *packet.after, *packet.estimates)]
    return MemoryDraft(
        role=role,
        subject=subject,
        knowledge=knowledge,
        verification="verified",
        provenance=provenance(
            step,
            sources=sorted(sources) or (verdict.verifier,),
            node_id=NodeId(closed.intent.node_id),
            packet_id=packet.identity.packet_id,
            blobs=blobs,
        ),
        valid_from_s=verdict.at_s,
        confidence=confidence_of(packet),
        fresh=fresh,
    )
