"""Lists everything for which a candidate is refused at proposal, before anything runs (D30, R156, R162). Pure."""

from harness.contracts.configuration import Configuration
from rsi_reviews.contracts import Candidate, RestrictionViolation
from rsi_reviews.manifest import unfounded
from rsi_reviews.restrictions import loosened
from rsi_reviews.runnable import unrunnable


def objections(candidate: Candidate, baseline: Configuration) -> tuple[RestrictionViolation, ...]:
    """What is wrong with its manifest, what it would loosen, and what would keep it from running, in this order."""
    return (
        *unfounded(candidate, baseline),
        *loosened(baseline, candidate.configuration),
        *unrunnable(baseline, candidate.configuration),
    )
