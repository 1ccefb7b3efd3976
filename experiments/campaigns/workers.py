"""Runs several workers on one PostgreSQL that is restarted under them: nothing may be lost or doubled, leases stay
exclusive.

The server belongs to the campaign. Every worker is a process with its own robots. Workers also take leases on each
other's bases, so that dispatches and leases meet. Every acknowledged append must be in the log at the end.
"""

import math
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from experiments.campaigns.chance import between, one_of
from experiments.campaigns.ledgers import exclusive_leases
from experiments.campaigns.simulate import CampaignWorkersLost, seeds_of
from experiments.campaigns.tally import Tally, tallied
from experiments.campaigns.worker_robots import Shift
from experiments.campaigns.worker_shift import AT_WORK, ENOUGH, WorkerFindings, work
from harness.adapters.stores.postgres import PostgresEventStore
from harness.contracts.errors import HarnessError
from harness.contracts.ports import StoredEvent
from harness.contracts.values import Value
from tools.postgres import PostgresServer, running_server

WORKERS = 4
ROBOTS_EACH = 2
EVERY_S = (5.0, 40.0)
AWAY_S = (0.1, 2.0)
MODES = ("fast", "immediate")
TELL_S = 10.0
MOST_RESTARTS = 10_000
EXAMPLES = 20
ONCE = {"MissionCreated": "mission_id", "DispatchIntended": "request_id", "NodeCommitted": "packet_id"}
"""Of these events there is one for each value of that field, in the whole log."""


class WorkersReport(Value):
    """The result of the workers. `outages`: times that a worker lost the database in the middle of a request.

    `acknowledged`: appends that were answered. `foreign_leases`: leases that workers took on each other's bases;
    `contended`: requests refused because somebody else held the base.
    """

    missions: int
    workers: int
    robots: int
    restarts: int
    crashes: int
    outages: int
    acknowledged: int
    events: int
    dispatches: int
    starts: int
    commits: int
    foreign_leases: int
    contended: int
    ends: dict[str, int]
    lost: int
    doubled: int
    seconds: float
    offences: tuple[str, ...]


def worked_missions(
    missions: int,
    *,
    seed: int,
    workers: int = WORKERS,
    every_s: tuple[float, float] = EVERY_S,
    most: int = MOST_RESTARTS,
    minutes: float | None = None,
) -> WorkersReport:
    """Run this many missions, or what `minutes` allow, while the server goes away at seeded moments; then judge.

    The first restart is timed from when a worker is at work; `most` is the largest number of restarts.
    """
    begun_s = time.monotonic()
    with TemporaryDirectory(prefix="workers-") as folder, running_server() as server:
        url = server.database()
        shifts = _shifts(seeds_of(seed, missions), url=url, folder=folder, workers=workers)
        PostgresEventStore(url).close()
        restarter = _Restarter(server, seed=seed, every_s=every_s, most=most)
        findings = _findings(shifts, restarter, minutes=minutes)
        store = PostgresEventStore(url)
        try:
            store.verify()
            log = store.read(limit=10_000_000)
            broken = []
        except HarnessError as error:
            log, broken = [], [f"the log does not verify: {error}"]
        finally:
            store.close()
    offences = [*broken, *_wrong(log, findings)]
    return _report(findings, log, restarter, offences=offences, seconds=time.monotonic() - begun_s)


def _shifts(seeds: Sequence[int], *, url: str, folder: str, workers: int) -> list[Shift]:
    names = [tuple(f"vbot-{worker + 1}-{robot + 1}" for robot in range(ROBOTS_EACH)) for worker in range(workers)]
    fleet = tuple(name for mine in names for name in mine)
    return [
        Shift(
            url=url,
            folder=folder,
            number=number,
            seeds=tuple(seeds[number::workers]),
            robots=names[number],
            fleet=fleet,
        )
        for number in range(workers)
        if seeds[number::workers]
    ]


class _Restarter:
    """Takes the server away at moments drawn from the seed: by its own shutdown, or as a crash."""

    def __init__(self, server: PostgresServer, *, seed: int, every_s: tuple[float, float], most: int) -> None:
        self._server, self._seed, self._every_s, self._most = server, seed, every_s, most
        self.restarts = 0
        self.crashes = 0
        self._next_s = math.inf

    def plan(self) -> None:
        """Draw the time of the next restart."""
        wait_s = between(self._seed, *self._every_s, "every", self.restarts)
        self._next_s = time.monotonic() + wait_s if self.restarts < self._most else math.inf

    @property
    def left_s(self) -> float:
        """Until the next restart."""
        return max(0.0, self._next_s - time.monotonic())

    def restart(self) -> None:
        """Restart now: away for a while, and back again."""
        mode = one_of(self._seed, MODES, "mode", self.restarts)
        self._server.stop(mode)
        time.sleep(between(self._seed, *AWAY_S, "away", self.restarts))
        self._server.start()
        self.restarts += 1
        self.crashes += mode == "immediate"
        self.plan()


def _findings(shifts: Sequence[Shift], restarter: _Restarter, *, minutes: float | None) -> list[WorkerFindings]:
    """The workers' findings. Raises WorkersLost where one of them dies."""
    folder, begun_s, told_s = Path(shifts[0].folder), time.monotonic(), time.monotonic()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["experiments.campaigns.worker_shift"])
    with ProcessPoolExecutor(len(shifts), mp_context=context) as pool:
        futures: list[Future[WorkerFindings]] = [pool.submit(work, shift) for shift in shifts]
        open_ = set(futures)
        try:
            while not any(folder.glob(f"{AT_WORK}-*")) and not any(one.done() for one in futures):
                time.sleep(0.05)
            restarter.plan()
            while open_:
                done, open_ = wait(open_, timeout=min(0.5, restarter.left_s), return_when=FIRST_EXCEPTION)
                for one in done:
                    one.result()
                if open_ and not restarter.left_s:
                    restarter.restart()
                if time.monotonic() - told_s > TELL_S:
                    told_s = time.monotonic()
                    print(f"{_done(folder)} missions, {restarter.restarts} restarts", file=sys.stderr, flush=True)
                if minutes is not None and time.monotonic() - begun_s > 60.0 * minutes:
                    (folder / ENOUGH).touch()
        except BrokenProcessPool as error:
            raise CampaignWorkersLost(
                f"A worker process died ({error})", where="workers", do="look at what it said"
            ) from error
        finally:
            (folder / ENOUGH).touch()
        return [one.result() for one in futures]


def _done(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.glob("done-*"))


def _wrong(log: Sequence[StoredEvent], findings: Sequence[WorkerFindings]) -> Iterator[str]:
    """Contradictions between log and workers, and what is in the log twice."""
    for one in findings:
        yield from (f"mission of seed {seed}: {sentence}" for seed, sentence in one.tally.offences)
        yield from lost(log, one.acknowledged)
    yield from doubled(log)
    created, judged = sum(event.kind == "MissionCreated" for event in log), sum(one.tally.missions for one in findings)
    if created != judged:
        yield f"{created} missions are in the log, {judged} were judged"
    yield from exclusive_leases(log)


def lost(log: Sequence[StoredEvent], acknowledged: Sequence[tuple[int, str]]) -> Iterator[str]:
    """Appends that were answered with this end of the log, which the log does not have."""
    for position, digest in acknowledged:
        if not 0 < position <= len(log) or log[position - 1].digest != digest:
            yield f"position {position} was acknowledged and is lost"


def doubled(log: Sequence[StoredEvent]) -> Iterator[str]:
    """Missions, dispatches and commits that are in the log more than once."""
    seen = Counter((event.kind, _field(event, ONCE[event.kind])) for event in log if event.kind in ONCE)
    yield from (f"{kind} of {name} stands {times} times" for (kind, name), times in seen.items() if times > 1)


def _field(event: StoredEvent, name: str) -> str:
    return str(msgspec.json.decode(event.body)[name])


def _report(
    findings: Sequence[WorkerFindings],
    log: Sequence[StoredEvent],
    restarter: _Restarter,
    *,
    offences: Sequence[str],
    seconds: float,
) -> WorkersReport:
    tally: Tally = tallied(one.tally for one in findings)
    conflicts = sum(b'"resource_conflict"' in event.body for event in log if event.kind == "FailureClassified")
    return WorkersReport(
        missions=tally.missions,
        workers=len(findings),
        robots=len(findings) * ROBOTS_EACH,
        restarts=restarter.restarts,
        crashes=restarter.crashes,
        outages=sum(one.outages for one in findings),
        acknowledged=sum(len(one.acknowledged) for one in findings),
        events=len(log),
        dispatches=tally.acts["dispatches"],
        starts=tally.acts["starts"],
        commits=tally.acts["commits"],
        foreign_leases=sum(one.taken for one in findings),
        contended=sum(one.refused for one in findings) + conflicts,
        ends=dict(sorted(tally.ends.items())),
        lost=sum(one.endswith("is lost") for one in offences),
        doubled=sum(one.endswith("times") for one in offences) + tally.found["duplicate_starts"],
        seconds=round(seconds, 1),
        offences=tuple(offences[:EXAMPLES]),
    )
