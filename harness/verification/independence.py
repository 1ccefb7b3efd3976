"""Pure: how independent of the executing provider an answer is (D17). Recorded for every condition."""

from harness.verification.finding import RECEIPTS


def independence(sources: tuple[str, ...], *, provider: tuple[str, ...] | None) -> int:
    """Level 0, 1 or 2 of a finding's sources against those that the provider uses itself.

    0: nothing but the provider's own word. 1: other software on a sensor or estimator that the provider uses too, or
    on one whose use is unknown. 2: only sensors and estimators that the provider does not use.
    """
    measured = [source for source in sources if source != RECEIPTS]
    if not measured:
        return 0
    if provider is None:
        return 1
    return 1 if set(measured) & set(provider) else 2


def described(level: int, required: int, *, sources: tuple[str, ...], reason: str) -> str:
    """The reason with what must be said about its sources: a single source, and whether that is enough."""
    if level < required:
        what = f"single source ({', '.join(sources) or 'none'}): independence {level}, required {required}"
        return f"{what}; {reason}" if reason else what
    return f"{reason} (single source: the provider's own word)" if level == 0 and sources else reason
