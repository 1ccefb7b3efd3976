"""Kills callers at random while they send requests to the gate, and checks that nothing is lost and nothing doubled.

All callers share one SQLite data folder. An acceptance in a caller's own journal must be in the log exactly once. A
request without an answer must be there at most once and whole. Everything that is folded from the log must give the
same result from zero.
"""

import multiprocessing
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.campaigns.chance import between, one_of
from experiments.campaigns.hammer_asks import (
    KEYED,
    SHARED_MISSIONS,
    HammerRequest,
    JournalContent,
    read_journal,
    requests_of,
    shared_mission,
)
from experiments.campaigns.hammer_caller import ENOUGH, CallerIdentity, call, creation, opened
from experiments.campaigns.hammer_judge import Keys, wrong
from harness.adapters.stores.folder import prepare
from harness.adapters.stores.sql import SqlEventStore
from harness.contracts.values import Value

CALLERS = 4
BETWEEN_S = (0.5, 5.0)
POINT = "after:HandoffApproved#2"
"""Where the first life of every caller ends: in the middle of an answer, with what it lets happen."""
FIRST = 4
"""So many times the longest life is the first one, if an append that met somebody else's leads it past its point."""
POINTED = 3
"""Of so many lives one has a fail-point behind a commit: a random kill seldom falls between that and its answer."""
GRACE_S = 120.0
FROM_BIRTH = 5
"""Of so many lives one is counted from its birth, so that a log is also left while it is opened."""
TELL_S = 10.0
LOOK_S = 0.03
EXAMPLES = 20


class HammerReport(Value):
    """The result of the hammering. `decisions`: acceptances that reached a caller.

    Of the `kills`, `in_question` struck between a request and its answer; of those requests `stood` were in the log all
    the same. `streams` were folded again from zero; for `snapshots` of them a snapshot was stored beside the log.
    """

    decisions: int
    refusals: int
    kills: int
    in_question: int
    stood: int
    events: int
    callers: int
    lost: int
    doubled: int
    streams: int
    snapshots: int
    offences: tuple[str, ...]


@dataclass
class _CallerRun:
    """One caller's process. It is killed `lasts_s` after it began to send requests, and now and then after its start.

    `said`: the length of its journal at its start. `until_s`: when it is killed, by a monotonic clock.
    """

    process: ForkServerProcess
    lasts_s: float
    said: int
    until_s: float
    lives: int = 1


def hammer(
    decisions: int, *, seed: int, callers: int = CALLERS, between_s: tuple[float, float] = BETWEEN_S
) -> HammerReport:
    """Let callers send requests until this many decisions were acknowledged, killing each at seeded moments;
    then judge.
    """
    with TemporaryDirectory(prefix="hammer-") as folder:
        data = Path(folder)
        _prepare(data)
        with ExitStack() as stack:
            store = SqlEventStore(prepare(data).log_url)
            stack.callback(store.close)
            pool = _CallerPool(data, store, seed=seed, callers=callers, between_s=between_s)
            stack.callback(pool.close)
            pool.run(decisions)
            pool.keys.follow(store)
            return pool.report([*pool.offences, *wrong(data, pool.keys, pool.journals())])


def _prepare(data: Path) -> None:
    """The missions that all callers write to."""
    with opened(data) as runtime:
        creating = creation(runtime)
        for slot in range(SHARED_MISSIONS):
            ask = HammerRequest(key=shared_mission(slot), kind="mission")
            runtime.commit(requests_of(ask, number=0, creating=creating))


class _CallerPool:
    """Starts callers, kills them, starts them again, and counts."""

    def __init__(
        self, data: Path, store: SqlEventStore, *, seed: int, callers: int, between_s: tuple[float, float]
    ) -> None:
        self._data, self._store, self._seed, self._between_s = data, store, seed, between_s
        self.keys = Keys()
        self._context: ForkServerContext = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["experiments.campaigns.hammer_caller"])
        self.kills = self.in_question = self.stood = 0
        self.offences: list[str] = []
        self._lives = {number: self._born(number, life=0) for number in range(callers)}

    def run(self, decisions: int) -> None:
        """Until the journals hold this many acknowledged decisions; then the callers may finish their requests."""
        told_s = time.monotonic()
        while (done := self._done()) < decisions and not self.offences:
            for number, life in self._lives.items():
                if life.lasts_s and _size(self._calling(number).journal) > life.said:
                    life.until_s, life.lasts_s = time.monotonic() + life.lasts_s, 0.0
                if time.monotonic() >= life.until_s or not life.process.is_alive():
                    self._ended(number, life)
            if time.monotonic() - told_s > TELL_S:
                told_s = time.monotonic()
                print(f"{done} of {decisions} decisions, {self.kills} kills", file=sys.stderr, flush=True)
            time.sleep(LOOK_S)
        (self._data / ENOUGH).touch()
        for number, life in self._lives.items():
            life.process.join(GRACE_S)
            if life.process.exitcode == -signal.SIGKILL:
                self._lives[number] = life = self._born(number, life=life.lives)
                life.process.join(GRACE_S)
            if life.process.exitcode != 0:
                self.offences.append(f"caller {number} ended with {life.process.exitcode} when it was enough")

    def _ended(self, number: int, life: _CallerRun) -> None:
        """Kill it, if it was not killed at its fail-point; check what became of its last request; start it again."""
        if life.process.is_alive():
            life.process.kill()
        life.process.join(GRACE_S)
        if life.process.exitcode != -signal.SIGKILL:
            self.offences.append(f"caller {number} ended by itself with {life.process.exitcode}")
            return
        self.kills += 1
        self._look(number)
        self._lives[number] = self._born(number, life=life.lives)

    def _look(self, number: int) -> None:
        """Checks that a request without an answer is in the log as a whole, or not at all."""
        last = read_journal(self._calling(number).journal).open
        if last is None:
            return
        self.keys.follow(self._store)
        standing = len(self.keys.positions.get(last.key, ()))
        self.in_question += 1
        self.stood += standing > 0
        if standing not in (0, last.requests):
            kinds = ", ".join(kind for key, kind in self.keys.kinds if key == last.key)
            self.offences.append(f"{last.key}, {last.kind}: {standing} of {last.requests} stand after a kill: {kinds}")

    def _born(self, number: int, *, life: int) -> _CallerRun:
        calling = self._calling(number, failpoint=self._point(number, life))
        process = self._context.Process(target=call, args=(calling,), daemon=True)
        process.start()
        lasts_s = between(self._seed, *self._between_s, "life", number, life) if life else FIRST * self._between_s[1]
        opening = life > 0 and life % FROM_BIRTH == 0
        until_s = time.monotonic() + (lasts_s if opening else GRACE_S)
        size = _size(calling.journal)
        return _CallerRun(process, lasts_s=0.0 if opening else lasts_s, said=size, until_s=until_s, lives=life + 1)

    def _point(self, number: int, life: int) -> str:
        """The fail-point of a process, if it has one; a random kill may come first."""
        if life == 0:
            return POINT
        kind = one_of(self._seed, tuple(KEYED), "point", number, life)
        return f"after:{kind}#{1 + life % 4}" if life % POINTED == 0 else ""

    def _calling(self, number: int, *, failpoint: str = "") -> CallerIdentity:
        return CallerIdentity(data=str(self._data), number=number, seed=self._seed, failpoint=failpoint)

    def _done(self) -> int:
        files = (self._calling(number).journal for number in self._lives)
        return sum(file.read_bytes().count(b'"done"') for file in files if file.exists())

    def journals(self) -> list[JournalContent]:
        """What every caller wrote down."""
        return [read_journal(self._calling(number).journal) for number in self._lives]

    def report(self, offences: Sequence[str]) -> HammerReport:
        """Everything that was counted, with these violations."""
        answers = Counter(answer for journal in self.journals() for answer in journal.answers.values())
        streams = dict.fromkeys(event.stream for event in self.keys.log)
        return HammerReport(
            decisions=answers["done"],
            refusals=answers["refused"],
            kills=self.kills,
            in_question=self.in_question,
            stood=self.stood,
            events=len(self.keys.log),
            callers=len(self._lives),
            lost=sum("is lost" in one for one in offences),
            doubled=sum("stands twice" in one for one in offences),
            streams=len(streams),
            snapshots=sum(self._store.snapshot(stream) is not None for stream in streams),
            offences=tuple(offences[:EXAMPLES]),
        )

    def close(self) -> None:
        """End what still runs."""
        for life in self._lives.values():
            if life.process.is_alive():
                life.process.kill()
            life.process.join(GRACE_S)


def _size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0
