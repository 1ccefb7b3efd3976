"""Derives from verdicts what each provider achieved in each setting: decayed sums and the newest examples. Pure.

The same functions fold the log as it grows, the records of the index at a first question, and the whole log for an
auditor, so that what routing was told can be derived again.
"""

from collections.abc import Iterable, Iterator

from harness.contracts import events
from harness.contracts.capabilities import Capability
from harness.contracts.ids import Digest, InvocationId, ProviderId
from harness.contracts.memory import MemoryRecord, OutcomeSums, ProviderOutcome
from harness.contracts.revision_events import CompletionDisputed, GraphRevised
from harness.contracts.values import Count, Value
from harness.memory.attempts import operational
from harness.memory.disputes import disputed
from harness.memory.draft import MissionStep, recorded

KINDS = frozenset(
    kind.__name__
    for kind in (
        events.MissionCreated, events.ContractCompiled, events.ContractRecompiled, GraphRevised,
        events.DispatchIntended, events.PacketRetained, events.VerdictRecorded, events.NodeCommitted,
        events.CommitRejected, events.MissionEnded, CompletionDisputed,
    )
)  # fmt: skip
"""The events that outcomes follow from."""
HALF_LIVES = 60
"""Outcomes older than this many half-lives weigh less than a sum can express and are not read."""
MOST_EXAMPLES = 16
"""So many of the newest successes are held for each setting."""
Setting = tuple[ProviderId, Capability, str, Digest]
"""Provider, capability, place and configuration."""


class OutcomeChange(Value):
    """What one event changes: an outcome that is new or, if it is not `first`, replaces the one of an earlier look at
    the same execution; without `record`, the outcome of that execution counts no longer."""

    position: Count
    execution: InvocationId
    provider_id: ProviderId
    record: MemoryRecord | None = None
    first: bool = True


class SettingOutcomes(Value):
    """What one provider achieved in one setting, up to `position`. `examples`: verified successes, newest first."""

    sums: OutcomeSums = OutcomeSums()
    examples: tuple[MemoryRecord, ...] = ()
    position: Count = 0


def changes(step: MissionStep) -> Iterator[OutcomeChange]:
    """What an event changes about outcomes."""
    for draft in operational(step):
        record = recorded(draft, supersedes=(), conflicts=(), verification=draft.verification)
        yield OutcomeChange(
            position=step.stored.position,
            execution=InvocationId(draft.subject.partition("/")[2]),
            provider_id=outcome_of(record).provider_id,
            record=record,
            first=draft.fresh,
        )
    for dispute in disputed(step):
        for kind, subject in dispute.disputes:
            execution = InvocationId(subject.partition("/")[2])
            if kind == "outcome":
                provider_id = step.before.intents[execution].provider_id
                yield OutcomeChange(position=step.stored.position, execution=execution, provider_id=provider_id)


def outcome_of(record: MemoryRecord) -> ProviderOutcome:
    """The outcome that a record of kind "outcome" holds."""
    if not isinstance(record.knowledge, ProviderOutcome):
        raise TypeError(f"{record.record_id} holds no outcome")
    return record.knowledge


def setting_of(outcome: ProviderOutcome) -> Setting:
    """What an outcome counts for."""
    return outcome.provider_id, outcome.capability, outcome.place, outcome.configuration


def extended(known: SettingOutcomes, record: MemoryRecord, *, half_life: float) -> SettingOutcomes:
    """The setting with one more outcome, the newest."""
    outcome = outcome_of(record)
    examples = (record, *known.examples)[:MOST_EXAMPLES] if outcome.verdict == "satisfied" else known.examples
    return SettingOutcomes(
        sums=known.sums.after(outcome.verdict, outcome.residual, half_life=half_life),
        examples=examples,
        position=record.provenance.position,
    )


def folded(records: Iterable[MemoryRecord], *, half_life: float, position: int) -> SettingOutcomes:
    """A setting from its outcomes, oldest first, as it stands at this position."""
    known = SettingOutcomes()
    for record in records:
        known = extended(known, record, half_life=half_life)
    return SettingOutcomes(sums=known.sums, examples=known.examples, position=position)
