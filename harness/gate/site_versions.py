"""The places of the site as people have changed them: now, and when a mission was compiled."""

from collections.abc import Callable
from threading import Lock
from typing import Any

from cachetools import LRUCache

from harness.contracts.ids import Digest, MissionId, PlaceId, StreamId, mission_stream
from harness.contracts.place_events import place_stream
from harness.contracts.places import Place, Site
from harness.contracts.ports import EventStore
from harness.gate.places import DECIDER as PLACE
from harness.projections.mission import Mission
from harness.projections.places import Places, changed_site

CACHED = 64
"""For how many missions the places they were compiled with are cached."""
COMPILED = ("ContractCompiled", "ContractRecompiled")


class SiteVersions:
    """`shipped`: the places without people's changes; `state`: the present fold of a stream."""

    def __init__(self, store: EventStore, state: Callable[[StreamId], Any], shipped: Site) -> None:
        self._store, self._state, self._shipped = store, state, shipped
        self._sites: LRUCache[tuple[MissionId, Digest], Site] = LRUCache(CACHED)
        self._caching = Lock()

    def now(self) -> Site:
        """What new missions are compiled with (R193)."""
        return changed_site(self._shipped, self.changes())

    def changes(self) -> Places:
        """The changes to this site's places."""
        places: Places = self._state(place_stream(self._shipped.name))
        return places

    def shipped_place(self, place_id: PlaceId) -> Place | None:
        """A place as it shipped, without people's changes."""
        return next((one for one in self._shipped.places if one.place_id == place_id), None)

    def of(self, mission: Mission) -> Site:
        """The places that a mission was compiled with; later changes do not affect it."""
        key = (mission.mission_id, mission.configuration)
        with self._caching:
            site = self._sites.get(key)
        if site is None:
            site = self._before(mission.mission_id)
            with self._caching:
                self._sites[key] = site
        return site

    def _before(self, mission_id: MissionId) -> Site:
        changes = self._store.load(place_stream(self._shipped.name))
        events = self._store.load(mission_stream(mission_id)) if changes else []
        compiled = [one.position for one in events if one.kind in COMPILED]
        known = [PLACE.codec.decode(one) for one in changes if compiled and one.position < compiled[-1]]
        return changed_site(self._shipped, PLACE.fold(PLACE.initial, known))
