"""Runs one viser server per reader of a mission. They listen on no network port and accept no commands."""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock

from cachetools import LRUCache

from app.i18n.catalogues import N_
from app.scene.feed import Feed
from app.scene.port import SceneFile
from app.scene.view import SceneView
from app.scene.viewer_server import ViewerFolder, ViewerServer
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId
from harness.runtime import Runtime
from harness.workers import Worker

TICK_S = 0.5
SOUGHT = 256
EXPORT_S, EXPORT_STEPS = 30.0, 60


class Scenes:
    """At most `limit` views, each made when it is first looked at and closed after `idle_s` without anybody."""

    def __init__(
        self,
        runtime: Runtime,
        *,
        idle_s: float = 120.0,
        limit: int = 16,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._runtime, self._idle_s, self._limit, self._clock = runtime, idle_s, limit, clock
        self._open: dict[tuple[MissionId, str], _ReaderViewer] = {}
        self._feeds: dict[MissionId, Feed] = {}
        self._params: LRUCache[tuple[MissionId, str], float | None] = LRUCache(SOUGHT)
        self._lock, self._stepping = Lock(), Lock()
        self._folder = ViewerFolder()
        self._worker = Worker("scenes", self.step, every_s=TICK_S)

    def socket(self, mission_id: MissionId, view: str = "") -> Path:
        """The Unix socket of one reader's viewer; raises UnknownName for a mission that does not exist."""
        self._runtime.mission(mission_id)
        with self._lock:
            seat = self._open.get((mission_id, view))
            if seat is None:
                feed = self._feeds.setdefault(mission_id, Feed(self._runtime, mission_id))
                seat = self._open[mission_id, view] = _ReaderViewer(feed, str(mission_id), self._folder.socket())
                seat.view.seek(self._params.get((mission_id, view)))
                self._worker.start()
            seat.seen_s = self._clock()
            longest_ago = sorted(self._open, key=lambda name: self._open[name].seen_s)
            surplus = [self._open.pop(name) for name in longest_ago[: max(len(self._open) - self._limit, 0)]]
            self._drop_feeds()
        for old in surplus:
            old.close()
        return seat.server.socket

    def touch(self, mission_id: MissionId, view: str = "") -> None:
        """Note that somebody still looks at this view."""
        with self._lock:
            if (mission_id, view) in self._open:
                self._open[mission_id, view].seen_s = self._clock()

    def seek(self, mission_id: MissionId, view: str, at_s: float | None) -> None:
        """Move one reader's view to an instant of mission time, None for the newest; now, or once it is opened."""
        with self._lock:
            self._params[mission_id, view] = at_s
            seat = self._open.get((mission_id, view))
        if seat is not None:
            seat.view.seek(at_s)

    def note(self, mission_id: MissionId) -> str:
        """What the views of a mission show and what they lack; a blank one says why."""
        with self._lock:
            feed = self._feeds.get(mission_id)
        return feed.note() if feed else N_("The 3D view opens when somebody looks at it.")

    def export(self, mission_id: MissionId, form: SceneFile, *, begin_s: float, end_s: float) -> bytes:
        """The whole mission as a recording that plays in EXPORT_S: a .viser file, or a page that needs nothing else."""
        feed = Feed(self._runtime, mission_id)
        feed.step()
        seat = _ReaderViewer(feed, str(mission_id), self._folder.socket(), whole=True)
        try:
            seat.view.step()
            seat.view.seek(begin_s)
            recording = seat.server.get_scene_serializer()
            for step in range(1, EXPORT_STEPS + 1):
                seat.view.seek(begin_s + (end_s - begin_s) * step / EXPORT_STEPS)
                recording.insert_sleep(EXPORT_S / EXPORT_STEPS)
            return recording.serialize() if form == "viser" else recording.as_html(dark_mode=True).encode()
        finally:
            seat.close()

    def close(self) -> None:
        with self._lock:
            seats, self._open = list(self._open.values()), {}
        self._worker.close()
        for seat in seats:
            seat.close()
        self._folder.close()

    def step(self) -> None:
        """Close the views that nobody watches and update the others."""
        with self._stepping:
            with self._lock:
                late = self._clock() - self._idle_s
                idle = [name for name, seat in self._open.items() if seat.seen_s < late]
                gone = [self._open.pop(name) for name in idle]
                self._drop_feeds()
                seats, feeds = list(self._open.values()), list(self._feeds.values())
            for seat in gone:
                seat.close()
            for feed in feeds:
                with suppress(HarnessError):
                    feed.step()
            for seat in seats:
                with suppress(HarnessError):
                    seat.view.step()

    def _drop_feeds(self) -> None:
        open_missions = {mission_id for mission_id, _ in self._open}
        self._feeds = {name: feed for name, feed in self._feeds.items() if name in open_missions}


class _ReaderViewer:
    """One reader's viewer: the server, and what is drawn on it."""

    def __init__(self, feed: Feed, label: str, socket: Path, *, whole: bool = False) -> None:
        self.server = ViewerServer(socket, label=label)
        self.view = SceneView(self.server, feed, whole=whole)
        self.seen_s = 0.0

    def close(self) -> None:
        self.server.close()
