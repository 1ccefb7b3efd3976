"""The hostile provider kit as a whole: its modes, and the counts that are published of a run."""

import ctypes
from collections.abc import Callable, Iterable, Sequence

from harness.conformance.hostile.evidence_lies import IMAGES, RECEIPTS, SENSORS
from harness.conformance.hostile.lies import BOUNDS, IDENTITIES, OUTCOMES, Mode
from harness.conformance.hostile.missions import MissionUnderLie, peak_memory_mib
from harness.conformance.hostile.motion_lies import MOTIONS
from harness.conformance.hostile.order_lies import ORDERS
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because
from harness.contracts.values import Value

MODES: tuple[Mode, ...] = (*BOUNDS, *OUTCOMES, *IDENTITIES, *RECEIPTS, *SENSORS, *IMAGES, *MOTIONS, *ORDERS)
ARENAS_AT_MOST, GIVEN_BACK_FROM = -8, -1
"""M_ARENA_MAX and M_TRIM_THRESHOLD of malloc.h; a threshold that is set no longer rises by itself."""
MOST_MIB = 400
"""How much memory the whole run may take at its peak, simulator and liar included."""


class LieReport(Value):
    """The counts of one run, and every mission of it. `undetectable` names the modes that forge every source.

    `against_truth`: of how many what was accepted was compared with the simulated world.
    """

    missions: int
    completions: int
    false_completions: int
    epistemic: int
    second_motions: int
    hangs: int
    tracebacks: int
    held: int
    against_truth: int
    peak_mib: int
    undetectable: tuple[str, ...]
    met: tuple[MissionUnderLie, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing happened that must not happen; an empty run shows nothing."""
        wrong = self.false_completions + self.second_motions + self.hangs + self.tracebacks + self.held
        return self.missions > 0 and not wrong and self.peak_mib <= MOST_MIB


def share_memory() -> None:
    """Let all threads allocate from two arenas and give back what they free, where the C library is glibc.

    The liar's server has a thread per connection; each would keep what it freed, and it would count as the harness's.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(ARENAS_AT_MOST, 2)
        mallopt(GIVEN_BACK_FROM, 128 << 10)


def chosen(names: Sequence[str]) -> tuple[Mode, ...]:
    """The modes of these names or groups, all of them without any. Raises UnknownName."""
    known = {mode.name for mode in MODES} | {mode.group for mode in MODES}
    strange = [name for name in names if name not in known]
    if strange:
        raise UnknownName(because("unknown_lie", name=strange[0], known=tuple(sorted(known))))
    return tuple(mode for mode in MODES if not names or mode.name in names or mode.group in names)


def fuzzed(
    modes: Iterable[Mode], meet: Callable[[Mode], MissionUnderLie], *, watch: Callable[[MissionUnderLie], None]
) -> LieReport:
    """Every mode one after the other, each a mission of its own."""
    share_memory()
    found: list[MissionUnderLie] = []
    for mode in modes:
        found.append(meet(mode))
        watch(found[-1])
    return counted(found, peak_mib=peak_memory_mib())


def counted(found: Sequence[MissionUnderLie], *, peak_mib: int) -> LieReport:
    """The counts of these missions; `peak_mib` is of the process that ran them."""
    return LieReport(
        missions=len(found),
        completions=sum(one.completed for one in found),
        false_completions=sum(one.false_completion for one in found),
        epistemic=sum(one.epistemic for one in found),
        second_motions=sum(one.second_motions for one in found),
        hangs=sum(one.hang for one in found),
        tracebacks=sum(bool(one.traceback) for one in found),
        held=sum(bool(one.held) for one in found),
        against_truth=sum(one.against_truth for one in found),
        peak_mib=peak_mib,
        undetectable=tuple(mode.name for mode in MODES if mode.undetectable),
        met=tuple(found),
    )
