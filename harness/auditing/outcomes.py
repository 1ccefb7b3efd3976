"""Folds from the whole log what routing was told of each provider, so that no stored sum has to be trusted."""

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Sequence

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import InvocationId, ProviderId
from harness.contracts.memory import MemoryRecord, OutcomeSums
from harness.contracts.ports import MISSION_STREAMS, StoredEvent
from harness.memory.outcomes import HALF_LIVES, KINDS, OutcomeChange, Setting, changes, folded, outcome_of, setting_of
from harness.memory.steps import LoadStream, MissionSteps
from harness.routing.history import SettingHistory

PAGE = 1000
CLOSE = 1e-9
"""Sums that were folded from another first outcome differ by their rounding."""
SameContract = Callable[[Sequence[MemoryRecord], CapabilityCard], list[MemoryRecord]]


class OutcomeLog:
    """The outcomes of a whole log as far as it was read, in order.

    `same_contract` leaves out what versions of a provider did that declare something else.
    """

    def __init__(
        self,
        *,
        read: Callable[[int, int], Sequence[StoredEvent]],
        stream: LoadStream,
        same_contract: SameContract,
    ) -> None:
        self._read = read
        self._steps = MissionSteps(stream=stream, kinds=KINDS)
        self._same_contract = same_contract
        self._position = 0
        self._changes: defaultdict[ProviderId, list[OutcomeChange]] = defaultdict(list)

    def differs(self, stored: SettingHistory, card: CapabilityCard, *, half_life: float) -> OutcomeSums | None:
        """What the log says instead of these stored sums; None if it says the same."""
        setting = (stored.provider_id, stored.capability, stored.place, stored.configuration)
        self._advance(stored.position)
        most = math.ceil(HALF_LIVES * half_life)
        newest = self._newest(setting, upto=stored.position, most=most)
        counted = self._same_contract(newest, card)
        again = folded(counted, half_life=half_life, position=stored.position).sums
        counts = {(one.judged, one.refuted) for one in (again, stored.sums)}
        alike = (
            (len(counts) == 1 or len(newest) == most)
            and math.isclose(again.failed, stored.sums.failed, rel_tol=CLOSE, abs_tol=CLOSE)
            and math.isclose(again.weight, stored.sums.weight, rel_tol=CLOSE, abs_tol=CLOSE)
        )
        return None if alike else again

    def _advance(self, position: int) -> None:
        """Read the log up to this position."""
        while self._position < position:
            events = self._read(self._position, PAGE)
            if not events:
                return
            for stored in events:
                step = self._steps.step(stored) if stored.stream.startswith(MISSION_STREAMS) else None
                for change in changes(step) if step else ():
                    self._changes[change.provider_id].append(change)
            self._position = events[-1].position

    def _newest(self, setting: Setting, *, upto: int, most: int) -> list[MemoryRecord]:
        """The newest outcomes that counted at that position, oldest first: none that was replaced or disputed."""
        known = self._changes[setting[0]]
        passed, found = set[InvocationId](), list[MemoryRecord]()
        for change in reversed(known[: bisect_right(known, upto, key=lambda one: one.position)]):
            if len(found) == most:
                break
            if change.execution in passed:
                continue
            passed.add(change.execution)
            if change.record is not None and setting_of(outcome_of(change.record)) == setting:
                found.append(change.record)
        return found[::-1]
