"""/evaluation: what the published evaluation and the recursion experiment found."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.background.published_results import published
from app.console import ActorDep, ConsoleDep
from app.i18n.catalogues import N_
from app.views.evaluation import MEASURES, EvaluationPage, evaluation_view, recursion_view
from app.web.rendering import render
from harness.contracts.errors import UnknownName

router = APIRouter(prefix="/evaluation")


@router.get("")
def show(console: ConsoleDep, actor: ActorDep, measure: str = "contract_false") -> HTMLResponse:
    if measure not in dict(MEASURES):
        raise UnknownName(f"Nothing is measured as {measure[:40]}", do=N_("choose one of the tabs"))
    found = published(console.settings.results)
    page = EvaluationPage(
        shell=console.shell("Evaluation", "evaluation", actor),
        evaluation=evaluation_view(found.evaluation, measure) if found.evaluation else None,
        recursion=recursion_view(found.recursion) if found.recursion else None,
        wrong=found.wrong,
    )
    return render("evaluation/index.html", page)
