"""Proposes one reasoned change at a time from what missions recorded (the trace miner). It is deterministic.

A rule looks at one kind of record, counts how often something happened and what it cost, and names the single parameter
of H that answers it. Gains are estimates for ranking; only the suite decides whether a change helps.
"""

from msgspec.structs import replace

from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid
from harness.recovery.policy import check_policy
from rsi_reviews.contracts import Author, Candidate
from rsi_reviews.generate.changes import ProposedChange, candidate
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.ladders import ladder_changes
from rsi_reviews.generate.places import routing_changes
from rsi_reviews.generate.times import item_changes, timeout_changes, wait_changes
from rsi_reviews.generate.trace import Trace

RULES = (ladder_changes, wait_changes, timeout_changes, routing_changes, item_changes)


class TraceMiner:
    """Implements `Generator` from records alone."""

    name = "trace-miner-1"

    def propose(self, trace: Trace, current: Configuration, budget: GenerationBudget) -> tuple[Candidate, ...]:
        """The changes that should pay most, without a configuration twice."""
        author = Author(name=self.name, kind="optimiser")
        found = ranked(mined(trace, current), current, budget)
        return tuple(candidate(change, current, author=author) for change in found)


def mined(trace: Trace, current: Configuration) -> tuple[ProposedChange, ...]:
    """Every change that some rule finds in the records, in the order of the rules."""
    return tuple(change for rule in RULES for change in rule(trace, current))


def ranked(
    found: tuple[ProposedChange, ...], current: Configuration, budget: GenerationBudget
) -> tuple[ProposedChange, ...]:
    """Changes that keep the policy sound and are new, the most worthwhile first; ties in the order they were found."""
    taken = {*budget.seen, current.configuration_id}
    changes: list[ProposedChange] = []
    for change in sorted(found, key=lambda change: -change.worth):
        identity = change.configuration.configuration_id
        if identity not in taken and change.worth > 0 and _sound(change.configuration):
            taken.add(identity)
            changes.append(change)
    return tuple(changes[: budget.candidates])


def _sound(configuration: Configuration) -> bool:
    try:
        check_policy(configuration.recovery)
    except ContractInvalid:
        return False
    return True


def merged(changes: tuple[ProposedChange, ...], current: Configuration) -> Configuration:
    """All changes in one configuration, each section's parts applied over the current ones; where two conflict, the
    first applies.
    """
    whole = current
    for change in reversed(changes):
        whole = _laid_over(whole, change.configuration, current)
    return whole


def _laid_over(under: Configuration, over: Configuration, base: Configuration) -> Configuration:
    """`under` with whatever `over` changed of `base`."""
    ladders = {
        name: over.recovery.ladders[name] if over.recovery.ladders[name] != ladder else under.recovery.ladders[name]
        for name, ladder in base.recovery.ladders.items()
    }
    recovery = replace(under.recovery, ladders=ladders)
    if over.recovery.wait_s != base.recovery.wait_s:
        recovery = replace(recovery, wait_s=over.recovery.wait_s)
    return replace(
        under,
        recovery=recovery,
        routing=over.routing if over.routing != base.routing else under.routing,
        context_rules=over.context_rules if over.context_rules != base.context_rules else under.context_rules,
        templates=tuple(
            new if new != old else lower
            for new, old, lower in zip(over.templates, base.templates, under.templates, strict=True)
        ),
    )
