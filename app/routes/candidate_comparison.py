"""/candidates/compare: two candidates side by side."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.console import ActorDep, Console, ConsoleDep
from app.i18n.catalogues import N_
from app.routes.candidate_evaluation import newest_job
from app.views.candidate_comparison import ComparedCandidate, ComparisonPage, comparison_page
from app.web.rendering import render
from harness.contracts.actors import Actor

router = APIRouter(prefix="/candidates")


@router.get("/compare")
def compare(console: ConsoleDep, actor: ActorDep, a: str = "", b: str = "") -> HTMLResponse:
    """Raises UnknownName."""
    return render("candidates/compare.html", page_of(console, actor, a[:64], b[:64]))


def page_of(console: Console, actor: Actor, first: str, second: str) -> ComparisonPage:
    releases = console.releases
    names = [releases.review(first).candidate, *([releases.review(second).candidate] if second else [])]
    found = []
    for name in names:
        results = console.evaluated.of(name)
        found.append(
            ComparedCandidate(
                review=releases.review(name),
                difference=releases.diff(name),
                measured=results[1] if results else None,
                clauses=releases.clauses(name),
                job=newest_job(console, name),
            )
        )
    shell = console.shell(N_("Two candidates"), "candidates", actor)
    second = names[1] if len(names) > 1 else ""
    return comparison_page(shell, found, releases.reviews(), first=names[0], second=second)
