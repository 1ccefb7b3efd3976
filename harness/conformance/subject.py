"""The provider under test with its clock, its observations, and the way to find it again after a restart."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from harness.contracts.ids import Digest
from harness.contracts.ports import Clock, Provider
from harness.contracts.protocol import Observations, PhysicalStart


@dataclass(frozen=True)
class ProviderUnderTest:
    """One provider, ready for one row.

    `reattached` gives the provider as a restarted supervisor would get it. `observations` and `starts` are None for a
    provider without a robot; `keep` is None where no blob can be stored beforehand.
    """

    provider: Provider
    clock: Clock
    reattached: Callable[[], Provider]
    blob: Callable[[Digest], bytes]
    observations: Callable[[int, int], Observations] | None = None
    starts: Callable[[], Sequence[PhysicalStart]] | None = None
    keep: Callable[[bytes], Digest] | None = None


Stand = Callable[[], ProviderUnderTest]
"""Gives a subject for the next row: a fresh one where that costs nothing, the same robot again where it is real."""
