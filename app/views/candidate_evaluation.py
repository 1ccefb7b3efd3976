"""Shapes the evaluation of a candidate on its page: what it would take, how far it is, and how it ended."""

from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext
from rsi_reviews.evaluation_jobs import EvaluationCost, EvaluationJob
from rsi_reviews.projections import Review

ENDS = {
    "done": N_("The evaluation is done; its answer stands below."),
    "cancelled": N_("The evaluation was cancelled. What was measured is kept."),
}


@dataclass(frozen=True)
class EvaluationPanel:
    """`cost` is None where nothing can be begun now; `percent` and `left_s` are of a job that runs.

    `ahead`: how many jobs run or wait before a queued one. `ended` says how the newest job ended.
    """

    candidate: str
    job: EvaluationJob | None
    cost: EvaluationCost | None
    ahead: int
    percent: float
    left_s: float | None
    ended: str
    may: bool

    @property
    def visible(self) -> bool:
        """Whether there is anything to say of an evaluation now."""
        return bool(self.cost or (self.job is not None and (self.job.open or self.ended)))


@dataclass(frozen=True)
class EvaluationRegion:
    """The evaluation of one candidate alone."""

    evaluation: EvaluationPanel


def evaluation_panel(
    review: Review,
    job: EvaluationJob | None,
    cost: EvaluationCost | None,
    *,
    ahead: int,
    now_s: float,
    may: bool,
) -> EvaluationPanel:
    """The panel as it is now."""
    return EvaluationPanel(
        candidate=review.candidate,
        job=job,
        cost=cost,
        ahead=ahead,
        percent=100.0 * job.done / job.of if job and job.of else 0.0,
        left_s=job.left_s(now_s) if job else None,
        ended=_ended(job) if job and review.evaluable else "",
        may=may,
    )


def _ended(job: EvaluationJob) -> str:
    if job.status == "failed":
        return lazy_gettext("The evaluation ended without a result: {why}", why=job.reason)
    return ENDS.get(job.status, "")
