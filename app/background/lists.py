"""Follows the log into the read models of the console's lists, and answers queries at the log's head."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from threading import Lock
from typing import Generic, TypeVar

from cachetools import LRUCache
from msgspec.structs import replace as changed

from harness.contracts import read_models
from harness.contracts.decider import Codec
from harness.contracts.errors import UnknownName
from harness.contracts.events import (
    CommitRejected,
    EffectDeclared,
    MissionEnded,
    MissionEvent,
    NodeCommitted,
    PacketRetained,
    VerdictRecorded,
)
from harness.contracts.ids import HandoffId, MissionId
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import ReadModels, StoredEvent
from harness.contracts.values import Value, decode
from harness.followers import Follower
from harness.projections.evidence_list import Placed, evidence_rows, touched
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission
from harness.projections.mission_fold import apply
from harness.projections.missions_list import handoff_row, mission_row
from harness.runtime import Runtime

FOLD = "lists-6"
"""The version of the rows; lists that another version made are built again."""
BATCH = 2000
KEPT = 64
OPEN = 500
TELLING = (PacketRetained, VerdictRecorded, NodeCommitted, EffectDeclared, CommitRejected)
Item = TypeVar("Item", bound=Value)


@dataclass(frozen=True)
class Slice(Generic[Item]):
    """One page of decoded items, and the query that asks for the next one; None at the end."""

    items: tuple[Item, ...]
    following: read_models.ListQuery | None


@dataclass(frozen=True)
class _FollowedMission:
    """A mission as far as it was followed: its state, when it began and ended, its events about evidence."""

    mission: Mission = field(default_factory=Mission)
    seq: int = 0
    began_s: float = 0.0
    ended_s: float | None = None
    telling: tuple[Placed, ...] = ()


class Lists:
    """The lists, safe between threads and processes: an answer includes everything committed before the call."""

    def __init__(self, runtime: Runtime, models: ReadModels) -> None:
        self._runtime, self._models = runtime, models
        self._codec: Codec[MissionEvent] = Codec(MissionEvent)
        self._followed: LRUCache[MissionId, _FollowedMission] = LRUCache(KEPT)
        self._follower = Follower(self, head=runtime.head, read=runtime.log, fold=FOLD, batch=BATCH)
        self._lock = Lock()

    def catch_up(self) -> FollowPosition:
        """Follow the log to its head, from zero where the lists are of another log or fold."""
        with self._lock:
            return self._follower.catch_up()

    def mark(self) -> FollowPosition:
        """How far the stored lists have followed the log."""
        return self._models.mark()

    def take(self, fresh: Sequence[StoredEvent], *, after: FollowPosition, upto: FollowPosition) -> None:
        """Store the rows that these events change. Raises ConcurrencyConflict if another process did."""
        self._models.add(list(self._rows(fresh)), after=after, upto=upto)

    def clear(self) -> None:
        """Forget every row."""
        self._models.clear()

    # pages ----------------------------------------------------------------------------------------------------------

    def missions(self, query: read_models.ListQuery) -> Slice[read_models.MissionItem]:
        return self._slice(query, read_models.MissionItem)

    def evidence(self, query: read_models.ListQuery) -> Slice[read_models.EvidenceItem]:
        return self._slice(query, read_models.EvidenceItem)

    def handoffs(self, query: read_models.ListQuery) -> Slice[read_models.HandoffItem]:
        return self._slice(query, read_models.HandoffItem)

    def open_missions(self) -> tuple[read_models.MissionItem, ...]:
        """Missions that have not ended, newest first, at most OPEN."""
        return self.missions(read_models.ListQuery(listing="mission", facets={"open": "yes"}, limit=OPEN)).items

    def open_handoffs(self) -> tuple[read_models.HandoffItem, ...]:
        """Questions that wait for a person, newest first, at most OPEN."""
        return self.handoffs(read_models.ListQuery(listing="handoff", facets={"open": "yes"}, limit=OPEN)).items

    def count(self, query: read_models.ListQuery) -> int:
        """How many items answer, counted up to MANY + 1."""
        self.catch_up()
        return self._models.count(query)

    def found(self, query: read_models.ListQuery, limit: Slice[Item]) -> int:
        """The same for a query whose page is known: a first page that is also the last is not searched for again."""
        return len(limit.items) if query.after is None and limit.following is None else self.count(query)

    def tallies(self, listing: read_models.Listing) -> list[read_models.FacetCount]:
        """Every value of every facet with its count."""
        self.catch_up()
        return self._models.tallies(listing)

    def close(self) -> None:
        self._models.close()

    # following ------------------------------------------------------------------------------------------------------

    def _slice(self, query: read_models.ListQuery, kind: type[Item]) -> Slice[Item]:
        self.catch_up()
        page = self._models.page(query)
        following = None if page.following is None else _after(query, page.following.amount, page.following.seq)
        return Slice(items=tuple(decode(body, kind) for body in page.bodies), following=following)

    def _rows(self, fresh: Sequence[StoredEvent]) -> Iterator[read_models.ListRow]:
        """Rows of every mission and question that these events are about."""
        by_stream: dict[str, list[StoredEvent]] = {}
        for stored in fresh:
            by_stream.setdefault(stored.stream, []).append(stored)
        for stream, events in by_stream.items():
            family, _, name = stream.partition("/")
            if family == "mission":
                yield from self._mission_rows(MissionId(name), events)
            elif family == "handoff":
                yield from self._handoff_rows(HandoffId(name), events)

    def _mission_rows(self, mission_id: MissionId, fresh: Sequence[StoredEvent]) -> Iterator[read_models.ListRow]:
        before = self._followed.get(mission_id)
        if before is None or before.mission.version + 1 != fresh[0].version:
            before = _FollowedMission()
            earlier = [one for one in self._runtime.events(mission_id) if one.version < fresh[0].version]
            fresh = [*earlier, *fresh]
        decoded = [(stored, self._codec.decode(stored)) for stored in fresh]
        after = _follow(before, decoded)
        self._followed[mission_id] = after
        yield mission_row(after.mission, seq=after.seq, began_s=after.began_s, ended_s=after.ended_s)
        packets = touched([event for _, event in decoded])
        yield from evidence_rows(after.telling, packets, robot_id=after.mission.robot_id)

    def _handoff_rows(self, handoff_id: HandoffId, fresh: Sequence[StoredEvent]) -> Iterator[read_models.ListRow]:
        known = self._models.body("handoff", handoff_id)
        seq = decode(known, read_models.HandoffItem).seq if known is not None else fresh[0].position
        handoff = self._runtime.handoff(handoff_id)
        row = handoff_row(handoff, self._asking(handoff), seq=seq)
        if row is not None:
            yield row

    def _asking(self, handoff: Handoff) -> Mission:
        """The mission a question is about, from what is followed if it is there; an empty one if the log has none."""
        mission_id = handoff.opened.mission_id if handoff.opened else MissionId("")
        if mission_id in self._followed:
            return self._followed[mission_id].mission
        try:
            return self._runtime.mission(mission_id)
        except UnknownName:
            return Mission()


def _follow(before: _FollowedMission, decoded: Sequence[tuple[StoredEvent, MissionEvent]]) -> _FollowedMission:
    first = decoded[0][0]
    ended = next((stored.recorded_s for stored, event in decoded if isinstance(event, MissionEnded)), before.ended_s)
    telling = tuple((stored.position, event) for stored, event in decoded if isinstance(event, TELLING))
    return replace(
        before,
        mission=reduce(apply, (event for _, event in decoded), before.mission),
        seq=before.seq or first.position,
        began_s=before.began_s if before.seq else first.recorded_s,
        ended_s=ended,
        telling=before.telling + telling,
    )


def _after(query: read_models.ListQuery, amount: float, seq: int) -> read_models.ListQuery:
    return changed(query, after=read_models.Bookmark(amount=amount, seq=seq))
