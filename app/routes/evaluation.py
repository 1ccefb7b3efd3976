"""/evaluation: what the published evaluation and the recursion experiment found."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.background.published_results import published_results
from app.console import ActorDep, ConsoleDep
from app.views.evaluation import MEASURES, EvaluationPage, evaluation_view, recursion_view
from app.web.rendering import render
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because

router = APIRouter(prefix="/evaluation")


@router.get("")
def show(console: ConsoleDep, actor: ActorDep, measure: str = "contract_false") -> HTMLResponse:
    if measure not in dict(MEASURES):
        raise UnknownName(because("unknown_measure", measure=measure[:40]))
    found = published_results(console.settings.results)
    page = EvaluationPage(
        shell=console.shell("Evaluation", "evaluation", actor),
        evaluation=evaluation_view(found.evaluation, measure) if found.evaluation else None,
        recursion=recursion_view(found.recursion) if found.recursion else None,
        wrong=found.wrong,
    )
    return render("evaluation/index.html", page)
