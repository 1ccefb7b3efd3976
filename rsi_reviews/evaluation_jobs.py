"""Defines the evaluations that people ask a running console for, and what one costs. Nothing here runs."""

from typing import Literal

from harness.contracts.actors import Actor
from harness.contracts.ids import Digest
from harness.contracts.reasons import Explanation
from harness.contracts.values import Count, Name, Value

JobStatus = Literal["queued", "running", "done", "cancelled", "failed"]
OPEN: frozenset[JobStatus] = frozenset({"queued", "running"})


class EvaluationJob(Value):
    """One evaluation that a person asked for. Missions are counted under both configurations; `kept` were stored
    before. `reason` says why it failed, or by whom it was cancelled.
    """

    job_id: Name
    candidate: Digest
    by: Actor
    asked_at_s: float
    processes: Count
    status: JobStatus = "queued"
    began_at_s: float | None = None
    ended_at_s: float | None = None
    done: Count = 0
    of: Count = 0
    kept: Count = 0
    bad: Count = 0
    answer: str = ""
    reason: Explanation = ""

    @property
    def open(self) -> bool:
        """Whether it waits or runs."""
        return self.status in OPEN

    def left_s(self, now_s: float) -> float | None:
        """How long it will still take at the pace so far; None before anything was measured."""
        ran = self.done - self.kept
        if self.status != "running" or self.began_at_s is None or ran < 1:
            return None
        return (self.of - self.done) * (now_s - self.began_at_s) / ran


class EvaluationCost(Value):
    """What an evaluation would take, before it begins: missions to run, those already kept, and seconds of this
    machine. `looks`: held-out looks taken so far; one more is spent only where everything else passes.
    """

    missions: Count
    kept: Count
    processes: Count
    seconds: float
    looks: Count
