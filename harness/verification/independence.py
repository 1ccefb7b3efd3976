"""Computes how independent of the executing provider an answer is (D17), recorded for every condition. Pure."""

from harness.contracts.reasons import Reason, because
from harness.verification.finding import RECEIPTS, Finding


def independence(sources: tuple[str, ...], *, provider: tuple[str, ...] | None) -> int:
    """Level 0, 1 or 2 of a finding's sources against those that the provider uses itself.

    0: nothing but the provider's own report. 1: other software on a sensor or estimator that the provider uses too, or
    on one whose use is unknown. 2: only sensors and estimators that the provider does not use.
    """
    measured = [source for source in sources if source != RECEIPTS]
    if not measured:
        return 0
    if provider is None:
        return 1
    return 1 if set(measured) & set(provider) else 2


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
