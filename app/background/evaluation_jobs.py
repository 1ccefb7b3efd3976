"""Evaluates candidates in the background of the running console: one after another, in processes of their own.

A job survives the console: finished cases are kept, and a job that was cut short goes on at the next start.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from threading import RLock
from typing import NamedTuple

import msgspec
from cachetools import LRUCache

from harness.adapters.process_priority import give_way
from harness.adapters.replaced_files import OWN, replacing
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused, refused
from harness.contracts.errors import HarnessError, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import Explanation, because
from harness.contracts.simulation import Simulator
from harness.contracts.values import Value, decode, digest, encode
from harness.runtime import Runtime
from harness.workers import Background, Worker
from rsi_reviews.contracts import EvaluationTerms, ResultSet
from rsi_reviews.evaluation_jobs import EvaluationCost, EvaluationJob
from rsi_reviews.held_out import Looks, secret_in
from rsi_reviews.regression.cases import Suite
from rsi_reviews.regression.executors import local
from rsi_reviews.regression.grown_suite import with_growth
from rsi_reviews.regression.results import ResultsFile, evaluator_version, results_path
from rsi_reviews.regression.runner import RunProgress
from rsi_reviews.regression.suite import shipped
from rsi_reviews.release_service import ReleaseService, SignedBy
from rsi_reviews.trial import HeldOut, Means, Trial, carried_out, judged_on, prepared

STEP_S = 0.5
JOBS = "jobs.json"
KEPT = 50
NICENESS = 10
WORKER_S = 1.0
"""Seconds of one process for one mission, as the shipped evaluation took them; later what the newest job here took."""


class _Queue(Value):
    """The stored file: every job, oldest first, and what one mission took one process in the newest finished one."""

    jobs: tuple[EvaluationJob, ...] = ()
    worker_s: float = WORKER_S


class _Message(Value):
    """What the evaluating process says: how far it is, what it measured, or why it gave up."""

    progress: RunProgress | None = None
    results: ResultSet | None = None
    failure: Explanation = ""


class _Order(NamedTuple):
    """What the evaluating process is given."""

    trial: Trial
    folder: Path
    processes: int
    simulator: Simulator
    now_s: Callable[[], float]
    fresh: Callable[[int], bytes]


@dataclass
class _Run:
    """The evaluating process of one job, and the connection to it."""

    job_id: str
    trial: Trial
    process: BaseProcess
    line: Connection

    def end(self) -> None:
        """Its workers end with it: the connection to each of them closes."""
        self.process.kill()
        self.process.join()
        self.line.close()


@dataclass
class EvaluationJobs(Background):
    """`ask`, `cancel` and the queries are for any thread; `step` moves the queue on, `watch` does so in the background.

    `clock` gives wall seconds, `now_s` seconds that only rise, `fresh` random bytes. `folder` is the evaluator's own,
    with its secret, its looks and the kept results. `processes` is how many a job gets that names none, 0 for none
    beside its own; `suites` are the regression and the safety suite.
    """

    runtime: Runtime
    folder: Path
    simulator: Simulator
    clock: Callable[[], float]
    now_s: Callable[[], float]
    fresh: Callable[[int], bytes]
    processes: int = max(1, (os.cpu_count() or 2) - 1)
    suites: Callable[[], tuple[Suite, Suite]] = lambda: (shipped("regression"), shipped("safety"))
    changed: Callable[[str], None] = lambda name: None
    _queue: _Queue = field(default_factory=_Queue)
    _run: _Run | None = None
    _terms: LRUCache[tuple[Digest, int], EvaluationTerms] = field(default_factory=lambda: LRUCache(KEPT))
    _lock: RLock = field(default_factory=RLock)
    _releases: ReleaseService = field(init=False)

    def __post_init__(self) -> None:
        """Raises StoreUnavailable where the stored jobs cannot be read."""
        self._releases = ReleaseService(self.runtime)
        self._worker = Worker("evaluations", self.step, every_s=STEP_S)
        self._queue = self._read()

    def close(self) -> None:
        """End the evaluating process; its job goes on at the next start."""
        super().close()
        with self._lock:
            if self._run is not None:
                self._over(self._run)

    # what people ask ------------------------------------------------------------------------------------------------

    def jobs(self) -> tuple[EvaluationJob, ...]:
        """Newest first."""
        with self._lock:
            return self._queue.jobs[::-1]

    def newest(self, candidate: Digest) -> EvaluationJob | None:
        """The newest job of a candidate."""
        return next((one for one in self.jobs() if one.candidate == candidate), None)

    def ahead(self, job: EvaluationJob) -> int:
        """How many jobs run or wait before this one."""
        waiting = [one for one in self.jobs()[::-1] if one.open]
        return next((place for place, one in enumerate(waiting) if one.job_id == job.job_id), 0)

    def cost(self, candidate: Digest, *, by: str, processes: int = 0) -> EvaluationCost:
        """What its evaluation would take on this machine. Raises UnknownName.

        A page asks this at every view: the trial is prepared once for a candidate and a suite.
        """
        key = (candidate, self._releases.growth().version)
        with self._lock:
            terms = self._terms.get(key)
            if terms is None:
                self._terms[key] = terms = self._trial(candidate, by).terms
        before = self._results_before(terms)
        missions, count = 2 * terms.cases, processes or self.processes
        seconds = (missions - before) * self._queue.worker_s / max(1, count)
        return EvaluationCost(
            missions=missions, kept=before, processes=count, seconds=seconds, looks=len(Looks(self.folder))
        )

    def ask(self, candidate: Digest, by: Actor, *, processes: int = 0) -> EvaluationJob | Refused:
        """Queue an evaluation; the one that waits or runs already is the same. Raises UnknownName."""
        review = self._releases.review(candidate)
        with self._lock:
            before = self.newest(review.candidate)
            if before is not None and before.open:
                return before
            if not review.evaluable:
                return refused("not_a_draft", status=review.status)
            asked_s = self.clock()
            job = EvaluationJob(
                job_id=f"evl_{sha256(f'{review.candidate}{asked_s}{len(self._queue.jobs)}'.encode())[:12]}",
                candidate=review.candidate,
                by=by,
                asked_at_s=asked_s,
                processes=processes or self.processes,
            )
            self._put(job)
            return job

    def cancel(self, candidate: Digest, by: Actor) -> EvaluationJob | Refused:
        """End it, or take it out of the queue. What was measured stays, and another job goes on from there."""
        with self._lock:
            job = self.newest(candidate)
            if job is None or not job.open:
                return refused("no_evaluation_open")
            if self._run is not None and self._run.job_id == job.job_id:
                self._over(self._run)
            ended = msgspec.structs.replace(
                job, status="cancelled", ended_at_s=self.clock(), reason=because("cancelled_by", actor=by.name)
            )
            self._put(ended)
            return ended

    # the queue ------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Read what the evaluating process says, and begin the next job where none runs."""
        with self._lock:
            if self._run is not None:
                self._listen(self._run)
            if self._run is None and (job := self._next()) is not None:
                self._begin(job)

    def _next(self) -> EvaluationJob | None:
        """The oldest open job; one that an earlier console left running comes first by itself."""
        return next((one for one in self._queue.jobs if one.open), None)

    def _begin(self, job: EvaluationJob) -> None:
        try:
            trial = self._trial(job.candidate, job.by.name)
            decision = self._releases.begin(trial.terms, self._signed(job, trial, "begin"))
        except HarnessError as error:
            self._fail(job, error.reason)
            return
        if isinstance(decision, Refused):
            self._fail(job, decision.reason)
            return
        context = multiprocessing.get_context("spawn")
        mine, theirs = context.Pipe()
        order = _Order(trial, self.folder, job.processes, self.simulator, self.now_s, self.fresh)
        process = context.Process(target=evaluate_in_child, args=(theirs, order), name="evaluation", daemon=False)
        process.start()
        theirs.close()
        self._run = _Run(job.job_id, trial, process, mine)
        self._put(msgspec.structs.replace(job, status="running", began_at_s=self.clock(), done=0, of=0, kept=0, bad=0))

    def _listen(self, run: _Run) -> None:
        job = next(one for one in self._queue.jobs if one.job_id == run.job_id)
        try:
            while run.line.poll():
                message = decode(run.line.recv_bytes(), _Message)
                if message.progress is not None:
                    now = message.progress
                    job = msgspec.structs.replace(job, done=now.done, of=now.of, kept=now.kept, bad=now.bad)
                    self._put(job, store=False)
                elif message.results is not None:
                    self._conclude(job, run, message.results)
                    return
                else:
                    self._over(run)
                    self._fail(job, message.failure)
                    return
        except (EOFError, OSError):
            self._over(run)
            self._fail(job, because("evaluation_process_lost"))

    def _conclude(self, job: EvaluationJob, run: _Run, results: ResultSet) -> None:
        """Judge and record what was measured. The report is made here: none comes from outside."""
        self._over(run)
        signed = self._signed(job, run.trial, "results")
        decision = self._releases.submit_results(judged_on(run.trial, results), signed)
        if isinstance(decision, Refused):
            self._fail(job, decision.reason)
            return
        review, now_s = self._releases.review(job.candidate), self.clock()
        ran = job.of - job.kept
        worker_s = (now_s - (job.began_at_s or now_s)) * max(1, job.processes) / ran if ran else self._queue.worker_s
        answer = review.evaluation.answer if review.evaluation else ""
        done = msgspec.structs.replace(job, status="done", ended_at_s=now_s, done=job.of, answer=answer)
        self._queue = msgspec.structs.replace(self._queue, worker_s=worker_s)
        self._put(done)

    def _over(self, run: _Run) -> None:
        run.end()
        self._run = None

    def _fail(self, job: EvaluationJob, reason: Explanation) -> None:
        self._put(msgspec.structs.replace(job, status="failed", ended_at_s=self.clock(), reason=reason))

    def _trial(self, candidate: Digest, by: str) -> Trial:
        """The trial under the terms that were fixed, where its evaluation was begun before."""
        review, growth = self._releases.review(candidate), self._releases.growth()
        found = self._releases.candidate(review.candidate)
        regression, safety = self.suites()
        return prepared(
            found,
            self.runtime.stored_configuration(found.baseline),
            (with_growth(regression, growth), safety),
            launched_by=review.terms.launched_by if review.terms else (by,),
            simulator=self.simulator,
            suite_edited_by=review.terms.suite_edited_by if review.terms else growth.hands,
        )

    def _results_before(self, terms: EvaluationTerms) -> int:
        """How many results under these terms their evaluator has kept; read only, for one may be adding to them."""
        path = results_path(self.folder, terms.evaluator)
        body = path.read_bytes() if path.is_file() else b""
        sides = (terms.baseline, terms.configuration)
        return sum(min(body.count(f'"configuration":"{one}"'.encode()), terms.cases) for one in sides)

    @staticmethod
    def _signed(job: EvaluationJob, trial: Trial, word: str) -> SignedBy:
        return SignedBy(job.by, f"evaluate: {word}", f"evaluate:{word}:{digest(trial.terms)}")

    # the file -------------------------------------------------------------------------------------------------------

    def _put(self, job: EvaluationJob, *, store: bool = True) -> None:
        jobs = {one.job_id: one for one in self._queue.jobs} | {job.job_id: job}
        self._queue = msgspec.structs.replace(self._queue, jobs=tuple(jobs.values())[-KEPT:])
        if store:
            self._write()
        self.changed(f"candidate/{job.candidate}")

    def _read(self) -> _Queue:
        path = self.folder / JOBS
        if not path.exists():
            return _Queue()
        try:
            return decode(path.read_bytes(), _Queue)
        except (OSError, msgspec.MsgspecError) as error:
            raise StoreUnavailable(because("evaluation_jobs_unreadable", error=str(error)), where=str(path)) from error

    def _write(self) -> None:
        """The whole file anew, in one step: a crash leaves the old one or the new one."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with replacing(self.folder / JOBS, mode=OWN) as file:
            file.write(encode(self._queue))


def evaluate_in_child(line: Connection, order: _Order) -> None:
    """The main of the evaluating process, below the console in priority. It ends when nobody listens any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    give_way(niceness=NICENESS)
    with suppress(BrokenPipeError):
        line.send_bytes(encode(_measured(line, order)))


def _measured(line: Connection, order: _Order) -> _Message:
    try:
        means = Means(
            executor=local(order.processes, order.simulator),
            now_s=order.now_s,
            kept=_results_in(order.folder, order.simulator),
            held_out=HeldOut(secret=secret_in(order.folder, order.fresh), looks=Looks(order.folder)),
            watch=lambda progress: line.send_bytes(encode(_Message(progress=progress))),
        )
        return _Message(results=carried_out(order.trial, means).results)
    except HarnessError as error:
        return _Message(failure=error.reason)


def _results_in(folder: Path, simulator: Simulator) -> ResultsFile:
    evaluator = evaluator_version(simulator.sources())
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return ResultsFile(results_path(folder, evaluator), evaluator=evaluator)
