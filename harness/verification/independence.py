"""Computes how independent of the executing provider an answer is (D17), recorded for every condition. Pure."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from harness.contracts.ids import ConditionId
from harness.contracts.reasons import Reason, because
from harness.contracts.verifier_inputs import Origins
from harness.verification.finding import BOOKKEEPING, RECEIPTS, Finding


@dataclass
class Lineage:
    """What one answer is derived from: the accepted facts that its predicate read, each with its level."""

    levels: dict[ConditionId, int] = field(default_factory=dict)

    def note(self, condition_id: ConditionId, level: int | None) -> None:
        """A fact whose level nobody recorded has level 0."""
        self.levels[condition_id] = level or 0


def independence(sources: tuple[str, ...], *, provider: tuple[str, ...] | None) -> int:
    """Rules 1: level 0, 1 or 2 of a finding's sources against those that the provider uses itself.

    0: nothing but the provider's own report. 1: other software on a sensor or estimator that the provider uses too, or
    on one whose use is unknown. 2: only sensors and estimators that the provider does not use.
    """
    measured = [source for source in sources if source != RECEIPTS]
    if not measured:
        return 0
    if provider is None:
        return 1
    return 1 if set(measured) & set(provider) else 2


def derived_independence(
    sources: tuple[str, ...], *, provider: tuple[str, ...] | None, origins: Origins, lineage: Lineage
) -> int:
    """Rules 2: the lowest level of everything the finding rests on.

    Its own sources have level 2 where the provider uses none of them and none has the origin of the provider or of
    what it reads, else 1. Its provider's report alone has level 0, as has a finding that rests on nothing. Accepted
    facts hand on their own level. The harness's own records are no source of the world.
    """
    measured = {source for source in sources if source not in (RECEIPTS, *BOOKKEEPING)}
    levels = list(lineage.levels.values())
    if measured:
        levels.append(2 if _apart(measured, provider=provider, origins=origins) else 1)
    elif RECEIPTS in sources:
        levels.append(0)
    return min(levels, default=0)


def _apart(measured: set[str], *, provider: tuple[str, ...] | None, origins: Origins) -> bool:
    if provider is None or not origins.provider:
        return False
    return not not_apart(measured, provider=provider, origins=origins)


def not_apart(
    measured: Iterable[str], *, provider: tuple[str, ...], origins: Origins
) -> dict[str, Literal["provider", "same_origin"]]:
    """The sources that the provider uses itself, and those that have its origin, or one of what it reads, or none that
    is known.
    """
    found: dict[str, Literal["provider", "same_origin"]] = {}
    for source in measured:
        if source in provider:
            found[source] = "provider"
        elif source not in origins.sources or origins.sources[source] in origins.provider:
            found[source] = "same_origin"
    return found


def labelled(finding: Finding, *, level: int, required: int) -> Reason:
    """The finding's reason, with a note on its sources: whether it rests on one only, and whether that is enough."""
    if finding.verdict == "satisfied" and level < required:
        return because(
            "too_few_independent_sources",
            sources=finding.sources or ("none",),
            level=level,
            required=required,
            reason=finding.reason,
        )
    if finding.verdict == "satisfied" and level == 0:
        return because("providers_word_alone", reason=finding.reason)
    return finding.reason
