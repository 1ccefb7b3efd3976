"""The 3D view: one viser server on loopback per mission that somebody looks at. Shows; never takes a command."""

import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Lock, Thread

import rich
import viser

from app.drawing import Drawing
from app.scene_feed import Feed
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId
from harness.runtime import Runtime

TICK_S = 0.5
_printing = Lock()


class Scenes:
    """At most `limit` scenes, each made on its first view and closed after `idle_s` without one."""

    def __init__(
        self,
        runtime: Runtime,
        *,
        idle_s: float = 600.0,
        limit: int = 8,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._runtime, self._idle_s, self._limit, self._clock = runtime, idle_s, limit, clock
        self._open: OrderedDict[MissionId, _Scene] = OrderedDict()
        self._lock, self._stepping = Lock(), Lock()
        self._closing = Event()
        self._thread: Thread | None = None

    def port(self, mission_id: MissionId) -> int:
        """The loopback port of the mission's viewer; raises UnknownName for a mission that does not exist."""
        self._runtime.mission(mission_id)
        with self._lock:
            scene = self._open.get(mission_id)
            if scene is None:
                scene = self._open[mission_id] = _Scene(self._runtime, mission_id)
                self._start()
            self._open.move_to_end(mission_id)
            scene.seen_s = self._clock()
            surplus = [self._open.popitem(last=False)[1] for _ in range(len(self._open) - self._limit)]
        for old in surplus:
            old.close()
        return scene.port

    def touch(self, mission_id: MissionId) -> None:
        """Somebody still looks."""
        with self._lock:
            if mission_id in self._open:
                self._open[mission_id].seen_s = self._clock()

    def note(self, mission_id: MissionId) -> str:
        """What the view shows and what it lacks; a blank one says why."""
        with self._lock:
            scene = self._open.get(mission_id)
        return scene.feed.note() if scene else "The 3D view opens when somebody looks at it."

    def close(self) -> None:
        self._closing.set()
        with self._lock:
            scenes, self._open = list(self._open.values()), OrderedDict()
            thread = self._thread
        if thread is not None:
            thread.join(timeout=5.0)
        for scene in scenes:
            scene.close()

    def _start(self) -> None:
        if self._thread is None:
            self._thread = Thread(target=self._run, name="scenes", daemon=True)
            self._thread.start()

    def step(self) -> None:
        """Close what nobody watches, feed the rest."""
        with self._stepping:
            with self._lock:
                late = self._clock() - self._idle_s
                idle = [name for name, scene in self._open.items() if scene.seen_s < late]
                gone = [self._open.pop(name) for name in idle]
                scenes = list(self._open.values())
            for scene in gone:
                scene.close()
            for scene in scenes:
                with suppress(HarnessError):
                    scene.feed.step()

    def _run(self) -> None:
        while not self._closing.wait(TICK_S):
            self.step()


class _Scene:
    """One mission's viewer: the server, what is drawn on it, and what feeds the drawing."""

    def __init__(self, runtime: Runtime, mission_id: MissionId) -> None:
        with _quiet():
            self._server = viser.ViserServer(host="127.0.0.1", port=0, label=str(mission_id), verbose=False)
        self.port: int = self._server.get_port()
        self.feed = Feed(runtime, mission_id, Drawing(self._server))
        self.seen_s = 0.0

    def close(self) -> None:
        with _quiet():
            self._server.stop()


@contextmanager
def _quiet() -> Iterator[None]:
    """viser announces itself on the console where `regen up` prints its one line."""
    console = rich.get_console()
    with _printing:
        before, console.quiet = console.quiet, True
        try:
            yield
        finally:
            console.quiet = before
