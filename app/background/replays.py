"""Replays uploaded recordings in the background of the running console, one after another, each as a mission."""

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from threading import Lock
from typing import Any, Protocol

from msgspec.structs import replace

from app.views.uploaded_files import ReplayJob, ReplayState
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid, HarnessError, UnknownName
from harness.contracts.ids import MissionId
from harness.contracts.reasons import because
from harness.contracts.values import Point
from harness.projections.mission import Mission
from harness.workers import Background, Worker

EVERY_S = 0.2
KEPT = 100
MOST_WAITING = 20


class OpenedRecording(Protocol):
    """A recording with a harness around it."""

    def run(
        self,
        actor: Actor,
        *,
        watch: Callable[[Mission], None],
        began: Callable[[MissionId], None],
        interrupted: Callable[[], bool],
    ) -> tuple[Mission, dict[str, Any]]: ...


class OpensRecording(Protocol):
    """Opens a recording beside the running harness; see harness/recordings.py."""

    def __call__(
        self, path: Path, *, target: Point | None, topics: tuple[str, ...], place: str, recover: bool
    ) -> AbstractContextManager[OpenedRecording]: ...


class ReplayJobs(Background):
    """`ask`, `cancel` and the queries are for any thread; `step` does what is next, `watch` does so in the background.

    `close` ends the replay that runs; its mission ends failed. What ran when a console ended otherwise is closed by the
    next one; its upload is still there.
    """

    def __init__(self, opens: OpensRecording, *, changed: Callable[[str], None] = lambda name: None) -> None:
        self._opens, self._changed = opens, changed
        self._jobs: dict[str, tuple[ReplayJob, Path, Actor]] = {}
        self._waiting: deque[str] = deque()
        self._lock = Lock()
        self._worker = Worker("replays", self.step, every_s=EVERY_S)

    def jobs(self) -> tuple[ReplayJob, ...]:
        """Newest first."""
        with self._lock:
            return tuple(job for job, _, _ in reversed(self._jobs.values()))

    def job(self, job_id: str) -> ReplayJob:
        """Raises UnknownName."""
        with self._lock:
            if job_id not in self._jobs:
                raise UnknownName(because("replay_unknown"))
            return self._jobs[job_id][0]

    def ask(self, job: ReplayJob, path: Path, actor: Actor) -> ReplayJob:
        """Put a replay at the end of the queue. Raises ContractInvalid where too many wait."""
        with self._lock:
            if len(self._waiting) >= MOST_WAITING:
                raise ContractInvalid(because("replays_too_many", limit=MOST_WAITING))
            self._jobs[job.job_id] = (job, path, actor)
            self._waiting.append(job.job_id)
            for old in list(self._jobs)[:-KEPT]:
                del self._jobs[old]
        self._changed("replays")
        return job

    def cancel(self, job_id: str) -> ReplayJob:
        """Take it out of the queue, or end it at its next step. Raises UnknownName."""
        job = self.job(job_id)
        return self._put(replace(job, state="cancelled")) if job.open else job

    def uses(self, upload_id: str) -> bool:
        """Whether a replay that waits or runs reads this upload."""
        return any(one.open and one.upload_id == upload_id for one in self.jobs())

    def step(self) -> None:
        """Run the next replay to its end."""
        with self._lock:
            job_id = self._waiting.popleft() if self._waiting else ""
            job, path, actor = self._jobs.get(job_id, (None, Path(), None))
        if job is None or actor is None or job.state != "waiting":
            return
        self._put(replace(job, state="reading"))
        try:
            ended = self._run(job_id, path, actor)
        except HarnessError as error:
            self._put(replace(self.job(job_id), state="refused", problem=error.what))
            return
        cancelled = self.job(job_id).state == "cancelled"
        state: ReplayState = "cancelled" if cancelled else "ended"
        self._put(replace(self.job(job_id), state=state, status=ended.status))

    def _run(self, job_id: str, path: Path, actor: Actor) -> Mission:
        job = self.job(job_id)
        with self._opens(
            path, target=job.target_m, topics=job.topics, place=job.place, recover=job.recover
        ) as replayer:
            mission, _ = replayer.run(
                actor,
                watch=lambda mission: None,
                began=lambda mission_id: self._began(job_id, mission_id),
                interrupted=lambda: self._worker.closed or self.job(job_id).state == "cancelled",
            )
        return mission

    def _began(self, job_id: str, mission_id: MissionId) -> None:
        job = self.job(job_id)
        self._put(replace(job, state="running" if job.open else job.state, mission_id=mission_id))

    def _put(self, job: ReplayJob) -> ReplayJob:
        with self._lock:
            _, path, actor = self._jobs[job.job_id]
            self._jobs[job.job_id] = (job, path, actor)
        self._changed("replays")
        return job
