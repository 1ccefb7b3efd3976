"""Folds whether one blob was erased, by whom and why. Pure."""

from msgspec.structs import replace

from harness.contracts.erasure_events import BlobErased
from harness.contracts.values import Count, Value


class Erasure(Value):
    """The tombstone of one blob; none while it is stored."""

    version: Count = 0
    erased: BlobErased | None = None


def apply(erasure: Erasure, event: BlobErased) -> Erasure:
    """The state after one more event."""
    return replace(erasure, version=erasure.version + 1, erased=event)
