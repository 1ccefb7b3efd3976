"""Counts repeated physical starts in a robot's start journal, for alerts, reports, canaries and campaigns. Pure."""

from collections.abc import Sequence

from harness.contracts.protocol import PhysicalStart


def repeated_starts(starts: Sequence[PhysicalStart]) -> int:
    """Physical starts beyond the first one of each request (D10)."""
    return len(starts) - len({start.request_id for start in starts})
