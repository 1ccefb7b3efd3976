"""/candidates: proposed changes to the harness itself, their reviews and releases."""

from itertools import islice
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.releases import ACTS, EvaluateCandidateAct
from app.auth.guarded_runtime import principal as present
from app.background.evaluations import situations
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.i18n.messages import reasoned
from app.routes import candidate_evaluation
from app.views import candidates
from app.views.candidates import BoardPage, CandidateListParams
from app.views.review import ReviewPage, ReviewSources, SubmittedReviewForm, review_page
from app.views.review_replay import ReplayPage, replay_page
from app.views.review_results import CasesPage, cases_page
from app.views.rollback import RollbackPage, rollback_page
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.decider import Codec
from harness.contracts.decisions import Refused
from harness.contracts.errors import ConfigurationMissing, ContractInvalid, UnknownName
from harness.contracts.ids import Digest, MissionId, mission_stream
from harness.contracts.ports import MISSION_STREAMS
from harness.contracts.reasons import because
from rsi_reviews.contracts import Subject
from rsi_reviews.counterfactual import counterfactual
from rsi_reviews.evaluation_jobs import EvaluationJob
from rsi_reviews.events import CandidateEvent, ReviewOpened
from rsi_reviews.projections import Review

router = APIRouter(prefix="/candidates")
REPLAYED = 40
CODEC: Codec[CandidateEvent] = Codec(CandidateEvent)


def asked_of(request: Request) -> CandidateListParams:
    """Search, filters and position from the address. Raises UnknownName or ContractInvalid for invalid ones."""
    params = request.query_params
    group, skip = params.get("status", ""), params.get("skip", "0")
    if group not in {value for value, _, _ in candidates.GROUPS}:
        raise UnknownName(because("unknown_candidate_tab", group=group[:40]))
    if not skip.isascii() or not skip.isdigit() or len(skip) > 6:
        raise ContractInvalid(because("list_offset_invalid", skip=skip[:40]), where="skip")
    return CandidateListParams(
        words=params.get("q", "")[:200].strip(),
        group=group,
        component=params.get("component", "")[:40],
        metric=params.get("metric", "")[:40],
        skip=int(skip),
    )


AskedDep = Annotated[CandidateListParams, Depends(asked_of)]


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, params: AskedDep) -> HTMLResponse:
    return render("candidates/index.html", board_of(console, actor, params))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep, params: AskedDep) -> HTMLResponse:
    return render("candidates/_list.html", board_of(console, actor, params))


@router.get("/{candidate}")
def show(console: ConsoleDep, actor: ActorDep, candidate: str) -> HTMLResponse:
    return render("candidates/detail.html", page_of(console, actor, candidate))


@router.get("/{candidate}/review")
def review(console: ConsoleDep, actor: ActorDep, candidate: str) -> HTMLResponse:
    return render("candidates/_review.html", page_of(console, actor, candidate))


@router.get("/{candidate}/cases")
def cases(
    console: ConsoleDep, actor: ActorDep, candidate: str, change: str = "", family: str = "", skip: int = 0
) -> HTMLResponse:
    return render("candidates/cases.html", cases_of(console, actor, candidate, change=change, family=family, skip=skip))


@router.get("/{candidate}/replay")
def replay(console: ConsoleDep, actor: ActorDep, candidate: str) -> HTMLResponse:
    return render("candidates/replay.html", replayed(console, actor, candidate))


@router.get("/{candidate}/rollback")
def rolling_back(console: ConsoleDep, actor: ActorDep, candidate: str) -> HTMLResponse:
    return render("candidates/rollback.html", rollback_of(console, actor, candidate))


@router.post("/{candidate}/evaluate")
def evaluate(console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, candidate: str, typed: FormDep) -> Response:
    """303 to the candidate, 422 for a number of processes that is none, 409 with the reason of a refusal."""
    act = EvaluateCandidateAct.from_form(typed)
    if isinstance(act, tuple):
        return _again(console, actor, candidate, typed, refused=" ".join(one.text for one in act), status=422)
    return _after_evaluation(
        console, actor, candidate, typed, candidate_evaluation.begin_evaluation(console, principal, candidate, act)
    )


@router.post("/{candidate}/cancel-evaluation")
def cancel_evaluation(
    console: ConsoleDep, actor: ActorDep, principal: PrincipalDep, candidate: str, typed: FormDep
) -> Response:
    decision = candidate_evaluation.cancel_evaluation(console, principal, candidate)
    return _after_evaluation(console, actor, candidate, typed, decision)


def _after_evaluation(
    console: Console, actor: Actor, candidate: str, typed: dict[str, str], decision: EvaluationJob | Refused
) -> Response:
    if isinstance(decision, Refused):
        return _again(console, actor, candidate, typed, refused=reasoned(decision.reason), status=409)
    return RedirectResponse(f"/candidates/{decision.candidate}", status_code=303)


@router.post("/{candidate}/{verb}")
def act(console: ConsoleDep, actor: ActorDep, candidate: str, verb: str, typed: FormDep) -> Response:
    """One act of app/acts/releases.py: 303, 422 not well said, 409 refused and why, with the page as it is now."""
    if verb not in ACTS:
        raise UnknownName(because("unknown_candidate_act", word=verb[:40]))
    name = console.releases.review(candidate).candidate
    act = ACTS[verb].from_form(typed)
    if isinstance(act, tuple):
        return _again(console, actor, name, typed, refused=" ".join(one.text for one in act), status=422)
    decision = console.releases.ask(name, act)
    if isinstance(decision, Refused):
        return _again(console, actor, name, typed, refused=reasoned(decision.reason), status=409)
    return RedirectResponse(f"/candidates/{name}", status_code=303)


def _again(
    console: Console, actor: Actor, candidate: str, typed: dict[str, str], *, refused: str, status: int
) -> Response:
    if "second-step" in typed:
        page = rollback_of(console, actor, candidate, refused=refused, typed=typed.get("reason", ""))
        return render("candidates/rollback.html", page, status=status)
    seen = _subject_in(console, candidate, typed.get("subject", ""))
    left = SubmittedReviewForm(reason=typed.get("reason", ""), refused=refused, subject=seen)
    return render("candidates/detail.html", page_of(console, actor, candidate, left), status=status)


def _subject_in(console: Console, candidate: str, digest: str) -> Subject | None:
    """The subject that a form was shown with, as it stood when its review was opened."""
    opened = (CODEC.decode(stored) for stored in console.releases.events(candidate))
    return next((one.subject for one in opened if isinstance(one, ReviewOpened) and one.subject_digest == digest), None)


def board_of(console: Console, actor: Actor, params: CandidateListParams) -> BoardPage:
    reviews = console.releases.reviews()
    jobs = {
        one.candidate: candidate_evaluation.newest_job(console, one.candidate)
        for one in reviews
        if one.status == "evaluating"
    }
    progress = {one.candidate: _progress(console, one, jobs[one.candidate]) for one in reviews if one.candidate in jobs}
    shell = console.shell("Candidates", "candidates", actor)
    refused = console.releases.refused_proposals()
    return candidates.board_page(shell, reviews, console.releases.pointer(), params, progress, refused, jobs)


def page_of(
    console: Console, actor: Actor, candidate: str, left: SubmittedReviewForm = SubmittedReviewForm()
) -> ReviewPage:
    """The page as it is now, with a fresh key. Raises UnknownName."""
    releases = console.releases
    review = releases.review(candidate)
    name = review.candidate
    found = console.evaluated.of(name)
    seen = ReviewSources(
        difference=releases.diff(name),
        measured=found[1] if found else None,
        clauses=releases.clauses(name),
        pointer=releases.pointer(),
        pins=releases.pins(),
        versions=releases.versions(),
        known=_known(console, [one.mission_id for one in review.manifest.motives] if review.manifest else []),
        loads=_loads(console, review.manifest.rollback if review.manifest else review.baseline),
        progress=_progress(console, review, candidate_evaluation.newest_job(console, name)),
    )
    shell = console.shell(candidates.title_of(review), "candidates", actor, topics=(f"candidate/{name}",))
    return review_page(
        shell,
        review,
        seen,
        actor,
        evaluation=candidate_evaluation.panel_of(console, present(), name),
        robots=console.settings.robots,
        key=console.sessions.key(),
        left=left,
        invited=present().invited,
    )


def _progress(console: Console, review: Review, job: EvaluationJob | None) -> str:
    """How far its evaluation is; empty where nothing evaluates it, also after it was cancelled."""
    return console.evaluated.progress(review) if candidates.status_shown(review, job) == "evaluating" else ""


def cases_of(console: Console, actor: Actor, candidate: str, *, change: str, family: str, skip: int) -> CasesPage:
    review = console.releases.review(candidate)
    found = console.evaluated.of(review.candidate)
    if found is None or review.manifest is None:
        raise UnknownName(because("candidate_not_measured"))
    shell = console.shell(N_("Every case"), "candidates", actor)
    return cases_page(shell, review, found[0], situations(), change=change, family=family, skip=skip)


def replayed(console: Console, actor: Actor, candidate: str) -> ReplayPage:
    """The newest stored missions under the candidate, decision by decision; no robot is touched."""
    releases, runtime = console.releases, console.runtime
    review = releases.review(candidate)
    newest = islice((one.mission_id for one in runtime.newest_missions() if not one.replay), REPLAYED)
    found: Any = counterfactual(runtime, runtime.stored_configuration(review.configuration), newest)
    rows = [
        (one.mission_id, one.template, one.status, sum(one.derived.values()), one.differences, len(one.unreadable))
        for one in found.missions
    ]
    shell = console.shell(N_("Counterfactual replay"), "candidates", actor)
    return replay_page(shell, review, rows, held=len(runtime.streams(MISSION_STREAMS)))


def rollback_of(console: Console, actor: Actor, candidate: str, *, refused: str = "", typed: str = "") -> RollbackPage:
    review = console.releases.review(candidate)
    shell = console.shell(N_("Roll back"), "candidates", actor)
    pinned = console.releases.pins().get(review.configuration, ())
    return rollback_page(
        shell, review, console.releases.pointer(), pinned, key=console.sessions.key(), refused=refused, typed=typed
    )


def _known(console: Console, missions: list[str]) -> frozenset[str]:
    return frozenset(one for one in missions if console.runtime.stream(mission_stream(MissionId(one))))


def _loads(console: Console, configuration: str) -> str:
    """Empty if the rollback target can be loaded at this moment and keeps its name, else why not."""
    try:
        same = console.releases.loads(Digest(configuration)) == configuration
    except ConfigurationMissing as error:
        return explained(error)
    return "" if same else N_("It loads, but not as the same version.")
