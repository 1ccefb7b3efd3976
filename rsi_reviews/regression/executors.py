"""Runs cases in this process, or on local processes that may die, hang or fail to start without harm to the run."""

import multiprocessing
import signal
from collections.abc import Generator, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Protocol

import msgspec

from harness.contracts.configuration import Configuration
from harness.contracts.errors import HarnessError
from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.values import Value, encode
from rsi_reviews.contracts import CaseResult
from rsi_reviews.regression.case_run import conducted
from rsi_reviews.regression.cases import Case
from rsi_reviews.regression.errors import WorkersLost
from rsi_reviews.regression.judge import judged

LONGEST_CASE_S = 120.0
START_S = 60.0
CHUNK = 8


class Job(Value):
    """Cases to run under one configuration; sent to a worker as JSON."""

    configuration: Configuration
    cases: tuple[Case, ...]


Running = Generator[tuple[CaseResult, ...], None, None]


class Executor(Protocol):
    """Runs jobs in any order and yields results as they come. Closing the generator cancels the rest."""

    def run(self, jobs: Sequence[Job]) -> Running:
        """Raises WorkersLost if no worker is left to go on; what was yielded stays valid."""


def run_job(job: Job, simulator: Simulator) -> tuple[CaseResult, ...]:
    """Every case of a job, one after another. A case that raises gives a result with the error."""
    return tuple(_one(case, job.configuration, simulator) for case in job.cases)


def _one(case: Case, configuration: Configuration, simulator: Simulator) -> CaseResult:
    try:
        return judged(conducted(case, configuration, simulator))
    except Exception as error:  # noqa: BLE001 - whatever a case raises is its result, never the end of the run
        return failed(case, configuration, outcome="crashed", note=f"{type(error).__name__}: {error}")


def failed(case: Case, configuration: Configuration, *, outcome: str, note: str) -> CaseResult:
    """A case without a measurement."""
    return msgspec.convert(
        {
            "case": case.case_id,
            "family": case.situation.family,
            "seed": case.seed,
            "configuration": configuration.configuration_id,
            "outcome": outcome,
            "note": note[:500],
        },
        CaseResult,
    )


class Here:
    """Runs one case after another in this process: for few cases, and for comparison."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator

    def run(self, jobs: Sequence[Job]) -> Running:
        """One tuple of results per job, in order."""
        yield from (run_job(job, self._simulator) for job in jobs)


class Processes:
    """`count` fresh interpreters that are kept for the whole run.

    A worker that dies or does not answer for `longest_s` per case costs its case, whose result says so, and is
    replaced.
    """

    def __init__(
        self, count: int, simulator: Simulator, *, longest_s: float = LONGEST_CASE_S, start_s: float = START_S
    ) -> None:
        self._count, self._simulator = count, simulator
        self._longest_s, self._start_s = longest_s, start_s
        self._context = multiprocessing.get_context("spawn")

    def run(self, jobs: Sequence[Job]) -> Running:
        """Results as workers finish, in no order. Raises WorkersLost if a worker cannot even start."""
        waiting = [Job(configuration=job.configuration, cases=part) for job in jobs for part in _parts(job.cases)]
        waiting.reverse()
        busy: dict[Connection, tuple[_CaseProcess, Job]] = {}
        workers: list[_CaseProcess] = []
        try:
            for _ in range(min(self._count, len(waiting))):
                workers.append(self._worker())
            for worker in workers:
                worker.greet(self._start_s)
                busy[worker.line] = (worker, worker.give(waiting.pop()))
            while busy:
                yield self._next(busy, waiting, workers)
        finally:
            for worker in workers:
                worker.end()

    def _next(
        self, busy: dict["Connection", tuple["_CaseProcess", Job]], waiting: list[Job], workers: list["_CaseProcess"]
    ) -> tuple[CaseResult, ...]:
        """The next finished part; for a worker that was lost, its first case gets a bad result and the rest is
        returned.
        """
        most = max(len(job.cases) for _, job in busy.values())
        ready = wait(list(busy), timeout=self._longest_s * most)
        line = next((one for one in busy if one in ready), next(iter(busy)))
        worker, job = busy.pop(line)
        results = worker.results() if ready else None
        if results is None:
            workers.remove(worker)
            worker.end()
            outcome = "crashed" if ready else "timed_out"
            lost = failed(job.cases[0], job.configuration, outcome=outcome, note=f"the worker was lost ({outcome})")
            rest = job.cases[1:] if len(job.cases) == 1 else job.cases
            if rest:
                waiting += [Job(configuration=job.configuration, cases=(case,)) for case in reversed(rest)]
            results = (lost,) if len(job.cases) == 1 else ()
            if waiting:
                worker = self._worker()
                workers.append(worker)
                worker.greet(self._start_s)
        if waiting:
            busy[worker.line] = (worker, worker.give(waiting.pop()))
        return results

    def _worker(self) -> "_CaseProcess":
        mine, theirs = self._context.Pipe()
        process = self._context.Process(
            target=work, args=(theirs, self._simulator), name="regression worker", daemon=True
        )
        process.start()
        theirs.close()
        return _CaseProcess(process, mine)


class _CaseProcess:
    """One worker process and the connection to it."""

    def __init__(self, process: BaseProcess, line: Connection) -> None:
        self._process, self.line = process, line

    def greet(self, start_s: float) -> None:
        """Wait until it has imported everything. Raises WorkersLost."""
        if not self.line.poll(start_s):
            raise WorkersLost(because("worker_silent", silent_s=start_s))
        try:
            self.line.recv_bytes()
        except (EOFError, OSError) as error:
            raise WorkersLost(because("worker_ended_at_once")) from error

    def give(self, job: Job) -> Job:
        self.line.send_bytes(encode(job))
        return job

    def results(self) -> tuple[CaseResult, ...] | None:
        """The worker's results; None if it died instead."""
        try:
            return msgspec.json.decode(self.line.recv_bytes(), type=tuple[CaseResult, ...])
        except (EOFError, OSError):
            return None

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self.line.close()


def work(line: Connection, simulator: Simulator) -> None:
    """The main loop of a worker: it greets, then answers each job with its results until the connection is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line.send_bytes(b"ready")
    while True:
        try:
            body = line.recv_bytes()
        except EOFError:
            return
        line.send_bytes(encode(run_job(msgspec.json.decode(body, type=Job), simulator)))


def _parts(cases: tuple[Case, ...]) -> Iterator[tuple[Case, ...]]:
    for begin in range(0, len(cases), CHUNK):
        yield cases[begin : begin + CHUNK]


def local(processes: int, simulator: Simulator) -> Executor:
    """The executor for this many local processes; 0 means this process. Raises HarnessError for a negative count."""
    if processes < 0:
        raise HarnessError(because("processes_negative", count=processes), where="processes")
    return Processes(processes, simulator) if processes else Here(simulator)
