"""Implements this project's own arm: no-op missions, approvals of a waiting mission, and folds of a whole log."""

import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from functools import lru_cache
from pathlib import Path
from typing import Any

from experiments.benchmarks.noop import OPERATOR, NoopHarness, noop_harness, template
from experiments.benchmarks.turns import Turn, mission_turns, serve, timed
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.commands import ApproveHandoff
from harness.contracts.decisions import Refused
from harness.contracts.ids import HandoffId, MissionId, RobotId, StreamId, mission_stream
from harness.contracts.ports import Batch, NewEvent
from harness.contracts.values import Moment
from harness.gate.decide import DECIDER as MISSION

PACKAGES = ("regenharness", "SQLAlchemy", "msgspec")
ROBOTS = 8
ROBOTS_OF_A_WORKER = 4
ONE = RobotId("noop-0")
MISSIONS_PER_APPEND = 50
MOST_STEPS = 50
DECIDING_S = 1.0
PROCESSES = os.cpu_count() or 1
STREAMS_AT_ONCE = 200


def missions(noop: NoopHarness) -> Turn:
    """Turns {missions, at_once}: one after another on one robot, or an equal share on every robot at once."""
    one_by_one = mission_turns(lambda number: noop.run(ONE))

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        count = request["missions"]
        return one_by_one(request) if request["at_once"] == 1 else timed(lambda: noop.run_together(count), count=count)

    return turn


class Approvals:
    """Turns {approvals}: seconds from the end of D28's observation to the provider's start, each."""

    def __init__(self) -> None:
        self._looked_s = self._began_s = 0.0
        self._shape = template(ONE, stages=2)

    def looked(self) -> None:
        self._looked_s = self._looked_s or time.perf_counter()

    def began(self) -> None:
        self._began_s = self._began_s or time.perf_counter()

    def turns(self, noop: NoopHarness) -> Turn:
        return lambda request: {"waits_s": [self._one(noop) for _ in range(request["approvals"])]}

    def _one(self, noop: NoopHarness) -> float:
        noop.providers[ONE].failing = True
        mission_id = _open_handoff(noop, noop.begin(ONE, shape=self._shape))
        noop.providers[ONE].failing = False
        approval = _approval(noop, mission_id)
        self._looked_s = self._began_s = 0.0
        decision = noop.supervisor.answer(*approval)
        wait_s = self._began_s - self._looked_s
        if isinstance(decision, Refused) or wait_s <= 0:
            raise RuntimeError(f"the approval started nothing: {decision}")
        for _ in range(MOST_STEPS):
            if noop.supervisor.step(mission_id) is None:
                return wait_s
        raise RuntimeError(f"the approved mission is still {noop.runtime.mission(mission_id).status}")


def _open_handoff(noop: NoopHarness, mission_id: MissionId) -> MissionId:
    """Run a mission whose provider fails until it waits for a person, who then takes a moment."""
    for _ in range(MOST_STEPS):
        wake_s = noop.supervisor.step(mission_id)
        status = noop.runtime.mission(mission_id).status
        noop.clock.wait_until(wake_s or 0.0)
        if status == "awaiting_human":
            noop.clock.wait_until(noop.clock.now().mission_s + DECIDING_S)
            return mission_id
    raise RuntimeError(f"the mission is {status} instead of asking")


def _approval(noop: NoopHarness, mission_id: MissionId) -> tuple[HandoffId, ApproveHandoff]:
    handoff_id = noop.runtime.mission(mission_id).handoff_id
    if handoff_id is None:
        raise RuntimeError("the mission waits without a handoff")
    handoff = noop.runtime.handoff(handoff_id)
    if handoff.opened is None:
        raise RuntimeError("the handoff was never opened")
    return handoff_id, ApproveHandoff(
        actor=OPERATOR,
        reason="seen",
        key=f"key-{handoff_id}",
        cycle=handoff.cycle,
        subject=handoff.opened.subject,
        evidence=handoff.opened.evidence,
    )


def together(noop: NoopHarness) -> Turn:
    """Turns {missions}: an equal share on every robot of this worker, while other workers do theirs."""
    noop.run(next(iter(noop.providers)))
    return lambda request: timed(lambda: noop.run_together(request["missions"]), count=request["missions"])


def rebuild_url(folder: Path) -> str:
    """Where the log that is folded lies."""
    return f"sqlite:///{folder / 'rebuild.db'}"


def filled(folder: Path, *, events: int) -> tuple[SqlEventStore, int]:
    """A log of at least `events` events: those of one real no-op mission, repeated in streams of their own."""
    (folder / "model").mkdir()
    with noop_harness(folder / "model") as noop:
        model = noop.runtime.events(noop.run(ONE).mission_id)
    new = tuple(NewEvent(kind=event.kind, body=event.body) for event in model)
    store, written = SqlEventStore(rebuild_url(folder)), 0
    while written < events:
        first = written // len(new)
        names = [mission_stream(MissionId(f"m{first + number:09}")) for number in range(MISSIONS_PER_APPEND)]
        store.append(
            [Batch(stream=name, expected_version=0, events=new) for name in names],
            (),
            Moment(mission_s=0.0, wall_s=0.0),
        )
        written += len(new) * len(names)
    return store, written


def rebuild(url: str, folds: ProcessPoolExecutor, *, events: int) -> Turn:
    """Turns {}: every mission of the log folded from its events, as the gate does at the first touch of each.

    Streams are independent, so that processes share them; they are started before the turn.
    """
    with closing(SqlEventStore(url)) as store:
        streams = list(store.streams("mission/"))
    parts = [streams[first : first + STREAMS_AT_ONCE] for first in range(0, len(streams), STREAMS_AT_ONCE)]
    list(folds.map(folded, (url,) * PROCESSES, ((),) * PROCESSES))

    def turn(request: dict[str, Any]) -> dict[str, Any]:
        start_s = time.perf_counter()
        done = list(folds.map(folded, (url,) * len(parts), parts))
        return {
            "wall_s": time.perf_counter() - start_s,
            "cpu_s": sum(cpu_s for _, cpu_s in done),
            "events": events,
            "ended": sum(ended for ended, _ in done),
        }

    return turn


@lru_cache(maxsize=1)
def _log(url: str) -> SqlEventStore:
    """This process's own connection to the log."""
    return SqlEventStore(url)


def folded(url: str, streams: Sequence[StreamId]) -> tuple[int, float]:
    """How many of these missions have ended, and the processor time of folding all of them."""
    start_s, store = time.process_time(), _log(url)
    decode = MISSION.codec.decode
    ended = sum(MISSION.fold(MISSION.initial, map(decode, store.load(stream))).ended for stream in streams)
    return ended, time.process_time() - start_s


def main() -> None:
    """Arguments: the folder, and `missions`, `approvals`, `rebuild` and how many events, or `worker`, its name and the
    address of the log."""
    folder, what = Path(sys.argv[1]), sys.argv[2]
    with closing(SqlEventStore(f"sqlite:///{folder / 'probe.db'}")) as probe:
        durability = dict(probe.durability())

    def answer(turn: Turn, name: str) -> None:
        serve(turn, name=name, packages=PACKAGES, durability=durability)

    _modes(folder)[what](answer)


def _modes(folder: Path) -> dict[str, Callable[[Callable[[Turn, str], None]], None]]:
    def run_missions(answer: Callable[[Turn, str], None]) -> None:
        with noop_harness(folder, robots=ROBOTS) as noop:
            answer(missions(noop), "RegenHarness, everything on")

    def run_approvals(answer: Callable[[Turn, str], None]) -> None:
        watch = Approvals()
        with noop_harness(folder, looked=watch.looked, began=watch.began, waits_for_people=True) as noop:
            answer(watch.turns(noop), "RegenHarness, handoff approved")

    def run_rebuild(answer: Callable[[Turn, str], None]) -> None:
        store, written = filled(folder, events=int(sys.argv[3]))
        store.close()
        with ProcessPoolExecutor(PROCESSES, mp_context=multiprocessing.get_context("spawn")) as folds:
            answer(rebuild(rebuild_url(folder), folds, events=written), "RegenHarness, mission folds")

    def run_worker(answer: Callable[[Turn, str], None]) -> None:
        with noop_harness(folder, robots=ROBOTS_OF_A_WORKER, worker=sys.argv[3], url=sys.argv[4]) as noop:
            answer(together(noop), "RegenHarness, worker on PostgreSQL")

    return {"missions": run_missions, "approvals": run_approvals, "rebuild": run_rebuild, "worker": run_worker}


if __name__ == "__main__":
    main()
