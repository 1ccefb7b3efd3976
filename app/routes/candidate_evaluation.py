"""/candidates/{id}/evaluation: how far the evaluation of a candidate is, and the acts that begin and end one."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.acts.releases import EvaluateCandidateAct
from app.auth.permissions import Principal
from app.console import Console, ConsoleDep
from app.views.candidate_evaluation import EvaluationPanel, EvaluationRegion, evaluation_panel
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.decisions import Refused, refused
from harness.contracts.ids import Digest
from rsi_reviews.evaluation_jobs import EvaluationJob

router = APIRouter(prefix="/candidates/{candidate}")


@router.get("/evaluation")
def now(console: ConsoleDep, principal: PrincipalDep, candidate: str) -> HTMLResponse:
    return render("candidates/_evaluation.html", EvaluationRegion(panel_of(console, principal, candidate)))


def begin_evaluation(
    console: Console, principal: Principal, candidate: str, act: EvaluateCandidateAct
) -> EvaluationJob | Refused:
    """Queue the evaluation in this person's name. Raises UnknownName, and NotPermitted before anything is queued."""
    actor, name = principal.acting("propose"), console.releases.review(candidate).candidate
    if console.evaluations is None:
        return refused("no_evaluations_here")
    job = console.evaluations.ask(name, actor, processes=act.processes)
    _record(console, principal, "EvaluateCandidate", name, job)
    return job


def cancel_evaluation(console: Console, principal: Principal, candidate: str) -> EvaluationJob | Refused:
    """End it in this person's name. Raises UnknownName and NotPermitted."""
    actor, name = principal.acting("propose"), console.releases.review(candidate).candidate
    if console.evaluations is None:
        return refused("no_evaluations_here")
    job = console.evaluations.cancel(name, actor)
    _record(console, principal, "CancelEvaluation", name, job)
    return job


def newest_job(console: Console, candidate: Digest) -> EvaluationJob | None:
    """The newest evaluation that this console was asked for; None where there is none."""
    return console.evaluations.newest(candidate) if console.evaluations else None


def panel_of(console: Console, principal: Principal, candidate: str) -> EvaluationPanel:
    """Raises UnknownName."""
    review, jobs = console.releases.review(candidate), console.evaluations
    job = newest_job(console, review.candidate)
    begins = jobs is not None and review.evaluable and not (job and job.open)
    return evaluation_panel(
        review,
        job,
        jobs.cost(review.candidate, by=principal.name) if jobs and begins else None,
        ahead=jobs.ahead(job) if jobs and job else 0,
        now_s=console.clock(),
        may=principal.may("propose"),
    )


def _record(
    console: Console, principal: Principal, act: str, candidate: Digest, decision: EvaluationJob | Refused
) -> None:
    outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
    console.sessions.accounts.record(principal, principal.actor, act, f"candidate/{candidate}", outcome)
