"""Holds what each provider achieved in each setting, from dispatch to dispatch, as the log grows.

A first question about a setting reads the index; after that every verdict costs two additions. What replaces an earlier
verdict, a dispute, or another version of the provider makes the setting be read from the index again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import RLock

from cachetools import LRUCache

from harness.contracts import memory
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import Digest
from harness.contracts.ports import MISSION_STREAMS, EventStore, StoredEvent
from harness.followers import Follower, beginning
from harness.memory.outcomes import (
    KINDS,
    OutcomeChange,
    Setting,
    SettingOutcomes,
    changes,
    extended,
    outcome_of,
    setting_of,
)
from harness.memory.steps import MissionSteps

FOLD = "outcomes"
MOST = 256
"""So many settings are held."""
ReadSetting = Callable[[CapabilityCard, Setting, float], tuple[memory.FollowPosition, SettingOutcomes]]
"""A setting's outcomes as the index gives them at the head of the log, and that head."""


@dataclass(frozen=True)
class _Held:
    """One setting as it is held, for one version of its provider."""

    version: str
    half_life: float
    outcomes: SettingOutcomes


class OutcomeHistory:
    """The settings that were asked about, at the head of the log. Safe between threads; other processes' events count.

    `read` answers for a setting that is not held.
    """

    def __init__(self, *, store: EventStore, read: ReadSetting) -> None:
        self._read = read
        self._lock = RLock()
        self._follower = Follower(self, head=store.head, read=store.read, fold=FOLD)
        self._steps = MissionSteps(stream=store.load, kinds=KINDS)
        self._mark: memory.FollowPosition | None = None
        self._settings: LRUCache[Setting, _Held] = LRUCache(MOST)

    def of(self, card: CapabilityCard, *, place: str, configuration: Digest, half_life: float) -> SettingOutcomes:
        """What this provider achieved in this setting, as its card now declares it, in all that is committed."""
        setting = (card.provider_id, card.capability, place, configuration)
        with self._lock:
            if self._mark is not None:
                self._follower.catch_up()
            held = self._settings.get(setting)
            if held is None or (held.version, held.half_life) != (card.version, half_life):
                held = _Held(card.version, half_life, self._first(card, setting, half_life))
                self._settings[setting] = held
            return held.outcomes

    def _first(self, card: CapabilityCard, setting: Setting, half_life: float) -> SettingOutcomes:
        """The setting from the index, at the very event that everything held here stands at."""
        while True:
            head, outcomes = self._read(card, setting, half_life)
            if self._mark is None:
                self._mark = self._at(head)
            if self._follower.catch_up() == self._at(head):
                return outcomes

    def mark(self) -> memory.FollowPosition:
        """How far the log was followed."""
        return self._mark or beginning(FOLD)

    def take(self, fresh: Sequence[StoredEvent], *, after: memory.FollowPosition, upto: memory.FollowPosition) -> None:
        """Follow one stretch of the log."""
        for stored in fresh:
            if stored.stream.startswith(MISSION_STREAMS):
                step = self._steps.step(stored)
                for change in changes(step) if step else ():
                    self._change(change)
        self._mark = upto

    def clear(self) -> None:
        """Forget everything: it came from another log. The next question reads the index."""
        self._settings.clear()
        self._steps.clear()
        self._mark = None

    def _change(self, change: OutcomeChange) -> None:
        if change.record is None or not change.first:
            for setting in [one for one in self._settings if one[0] == change.provider_id]:
                del self._settings[setting]
            return
        outcome = outcome_of(change.record)
        setting = setting_of(outcome)
        held = self._settings.get(setting)
        if held is None:
            return
        if held.version != outcome.provider_version:
            del self._settings[setting]
            return
        outcomes = extended(held.outcomes, change.record, half_life=held.half_life)
        self._settings[setting] = _Held(held.version, held.half_life, outcomes)

    @staticmethod
    def _at(head: memory.FollowPosition) -> memory.FollowPosition:
        return memory.FollowPosition(fold=FOLD, position=head.position, digest=head.digest)
