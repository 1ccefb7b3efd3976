"""The places and routes of the site, and its own missions, as people have changed them: now, and when a mission was
compiled.
"""

from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any

from cachetools import LRUCache

from harness.contracts.ids import Digest, MissionId, PlaceId, StreamId, mission_stream
from harness.contracts.place_events import place_stream
from harness.contracts.places import Place, Route, Site
from harness.contracts.ports import EventStore, StoredEvent
from harness.contracts.site_events import site_stream
from harness.contracts.tasks import TaskTemplate
from harness.gate.places import DECIDER as PLACE
from harness.gate.site_changes import DECIDER as CHANGES
from harness.projections.mission import Mission
from harness.projections.places import Places, changed_site
from harness.projections.site_changes import SiteChanges, with_routes, with_templates

CACHED = 64
"""For how many missions the places they were compiled with are cached."""
COMPILED = ("ContractCompiled", "ContractRecompiled")


class SiteVersions:
    """`shipped`: the site without people's changes, `missions`: its own; `state`: the present fold of a stream."""

    def __init__(
        self, store: EventStore, state: Callable[[StreamId], Any], shipped: Site, missions: Sequence[TaskTemplate] = ()
    ) -> None:
        self._store, self._state, self._shipped, self._missions = store, state, shipped, tuple(missions)
        self._sites: LRUCache[tuple[MissionId, Digest], Site] = LRUCache(CACHED)
        self._caching = Lock()

    def now(self) -> Site:
        """What new missions are compiled with (R193)."""
        return with_routes(changed_site(self._shipped, self.changes()), self.definition())

    def missions(self) -> tuple[TaskTemplate, ...]:
        """The site's own missions that can be started now."""
        return with_templates(self._missions, self.definition())

    def definition(self) -> SiteChanges:
        """The changes to this site's routes and missions."""
        changes: SiteChanges = self._state(site_stream(self._shipped.name))
        return changes

    def changes(self) -> Places:
        """The changes to this site's places."""
        places: Places = self._state(place_stream(self._shipped.name))
        return places

    def shipped_place(self, place_id: PlaceId) -> Place | None:
        """A place as it shipped, without people's changes."""
        return next((one for one in self._shipped.places if one.place_id == place_id), None)

    def shipped_route(self, name: str) -> Route | None:
        """A route as it shipped, without people's changes."""
        return next((one for one in self._shipped.routes if one.name == name), None)

    def shipped_mission(self, name: str) -> TaskTemplate | None:
        """One of the site's own missions without people's changes."""
        return next((one for one in self._missions if one.name == name), None)

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
        places = self._store.load(place_stream(self._shipped.name))
        routes = self._store.load(site_stream(self._shipped.name))
        events = self._store.load(mission_stream(mission_id)) if places or routes else []
        compiled = [one.position for one in events if one.kind in COMPILED]

        def known(changes: Sequence[StoredEvent]) -> list[StoredEvent]:
            return [one for one in changes if compiled and one.position < compiled[-1]]

        stood = changed_site(self._shipped, PLACE.fold(PLACE.initial, map(PLACE.codec.decode, known(places))))
        return with_routes(stood, CHANGES.fold(CHANGES.initial, map(CHANGES.codec.decode, known(routes))))
