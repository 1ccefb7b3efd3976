"""/missions/{id}/report: a mission's report as page, PDF and JSON; its dossier; its log; each fact."""

from collections.abc import Sequence
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Query
from starlette.background import BackgroundTask
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, RedirectResponse, Response

from app.acts.missions import DisputeCompletionAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.languages import CHOICE
from app.i18n.messages import lazy_gettext, reasoned
from app.views import events, facts, report
from app.views.facts import FactPage
from app.views.marked_pictures import marked_pictures
from app.views.mission_json import mission_outcome, no_answer_outcome
from app.views.readings import goal_words
from app.views.report import ReportPage, ReportSources
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.control import CONTROL, ControlEvent
from harness.contracts.decider import Codec
from harness.contracts.decisions import Refused
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.events import HandoffAnswered
from harness.contracts.handoff_events import HandoffEvent, HandoffOpened, NoAnswerTaken
from harness.contracts.ids import Digest, HandoffId, MissionId, handoff_stream
from harness.contracts.observations import SINGLE_SOURCE
from harness.contracts.reasons import because
from harness.contracts.retreat_events import RetreatEnded, RetreatEvent, RetreatIntended, RetreatStopping
from harness.contracts.revision_commands import DisputeCompletion
from harness.projections.handoffs import NoAnswerAction
from harness.projections.starts import repeated_starts
from rsi_reviews.release_service import SignedBy

router = APIRouter(prefix="/missions/{mission_id}")
LONGEST = 200
QUESTION: Codec[HandoffEvent] = Codec(HandoffEvent)
CONTROL_EVENTS: Codec[ControlEvent] = Codec(ControlEvent)


@router.get("/report")
def printable(console: ConsoleDep, actor: ActorDep, mission_id: MissionId) -> HTMLResponse:
    return render("missions/report.html", page_of(console, actor, mission_id))


@router.get("/report.pdf")
def portable(console: ConsoleDep, actor: ActorDep, mission_id: MissionId) -> Response:
    """The printable report as one file with its pictures; only those whose bytes verify now."""
    from app.web.report_pdf import report_pdf  # noqa: PLC0415  its library loads for a second, which no command needs

    page = page_of(console, actor, mission_id)
    pictures = {one.blob: console.runtime.blob(Digest(one.blob)) for one in page.pictures if not one.broken}
    fonts, language = console.settings.static / "vendor", CHOICE.get().language
    made = report_pdf(page, pictures, fonts=fonts, made_s=console.clock(), language=language)
    name = f'attachment; filename="{mission_id}.pdf"'
    return Response(made.body, media_type="application/pdf", headers={"Content-Disposition": name})


@router.get("/dossier")
def dossier(console: ConsoleDep, principal: PrincipalDep, mission_id: MissionId) -> Response:
    """Events, verdicts, decisions and evidence in one signed file, which `regen verify` checks offline."""
    actor = principal.acting("export")
    console.runtime.mission(mission_id)
    if console.dossier is None:
        raise UnknownName(because("no_signing_key"))
    folder = Path(mkdtemp(prefix="dossier-"))
    file = folder / f"{mission_id}.dossier.zip"
    try:
        console.dossier(mission_id, file, actor.name)
    except HarnessError:
        rmtree(folder, ignore_errors=True)
        raise
    left = BackgroundTask(rmtree, folder, ignore_errors=True)
    return FileResponse(file, media_type="application/zip", filename=file.name, background=left)


def page_of(console: Console, actor: Actor, mission_id: MissionId, errors: Sequence[str] = ()) -> ReportPage:
    """The report as it stands now; every picture's bytes are read and hashed."""
    entries = console.histories.of(mission_id)
    mission = console.runtime.mission(mission_id)
    broken = {blob: console.check(Digest(blob)) for blob, _, _ in report.pictures(entries)}
    shell = console.shell(lazy_gettext("Report: {goal}", goal=goal_words(mission)), "missions", actor)
    marked = marked_pictures(entries, console.runtime.blob)
    return report.report_page(
        shell, mission, entries, _journal(console, mission_id), broken, marked=marked, errors=errors
    )


@router.get("/report.json")
def machine_readable(console: ConsoleDep, mission_id: MissionId) -> JSONResponse:
    """The object that `regen mission run --json` prints, with timings, what was done where nobody answered, and the
    place in the log it stands at.
    """
    entries = console.histories.of(mission_id)
    mission = console.runtime.mission(mission_id)
    body: dict[str, Any] = mission_outcome(mission, entries, console.journal(mission_id))
    body["timings"] = [vars(one) for one in report.timings(mission, entries)]
    body["no_answer"] = _no_answer(console, mission_id)
    body[SINGLE_SOURCE] = mission.labels.get(SINGLE_SOURCE, "")
    body["log"] = {"position": entries[-1].position, "digest": entries[-1].digest}
    return JSONResponse(body, headers={"Content-Disposition": f'attachment; filename="{mission_id}.json"'})


@router.get("/log")
def log(
    console: ConsoleDep,
    actor: ActorDep,
    mission_id: MissionId,
    q: Annotated[str, Query(max_length=LONGEST)] = "",
    family: str = "",
    after: Annotated[int, Query(ge=0)] = 0,
) -> HTMLResponse:
    """Events after a position that hold every word of `q`, of one family or of all."""
    entries = console.histories.of(mission_id)
    shell = console.shell("Events", "missions", actor)
    page = events.log_page(shell, mission_id, entries, events.EventQuery(words=q, family=family, after=after))
    return render("missions/log.html", page)


@router.get("/facts/{packet_id}/{condition_id}")
def fact(
    console: ConsoleDep, actor: ActorDep, mission_id: MissionId, packet_id: str, condition_id: str
) -> HTMLResponse:
    """One accepted fact, down to blobs that are read and hashed now."""
    return render("missions/fact.html", _fact(console, actor, mission_id, (packet_id, condition_id)))


@router.post("/case")
def case(console: ConsoleDep, principal: PrincipalDep, mission_id: MissionId) -> Response:
    """A disputed or failed mission becomes a case of the regression suite: every later candidate has to pass it.

    303 to the proposal of a change that answers it, for those who may propose one.
    """
    mission = console.runtime.mission(mission_id)
    reason = reasoned(mission.disputes[-1].reason) if mission.disputes else f"{mission.template}: {mission.status}"
    decision = console.releases.add_case(
        mission_id, SignedBy(actor=principal.acting("dispute"), reason=reason, key=mission_id)
    )
    if isinstance(decision, Refused):
        page = page_of(console, principal.actor, mission_id, (reasoned(decision.reason),))
        return render("missions/report.html", page, status=409)
    proposal, report = f"/candidates/new?mission={mission_id}", f"/missions/{mission_id}/report#case"
    return RedirectResponse(proposal if principal.may("propose") else report, status_code=303)


@router.post("/facts/{packet_id}/{condition_id}/dispute")
def dispute(
    console: ConsoleDep,
    principal: PrincipalDep,
    mission_id: MissionId,
    packet_id: str,
    condition_id: str,
    typed: FormDep,
) -> Response:
    """Say that this acceptance is wrong (D21). `from` says which page it was said on, to go back to it."""
    actor = principal.acting("dispute")
    act = DisputeCompletionAct.from_form(typed)
    if isinstance(act, tuple):
        wrong, status = tuple(one.text for one in act), 422
    else:
        command = act.to_command(actor, condition_id=condition_id)
        wrong, status = _disputed(console, mission_id, packet_id, command), 409
    reported = typed.get("from") == "report"
    if wrong and reported:
        return render("missions/report.html", page_of(console, principal.actor, mission_id, wrong), status=status)
    if wrong:
        page = _fact(console, principal.actor, mission_id, (packet_id, condition_id), wrong)
        return render("missions/fact.html", page, status=status)
    back = "report#facts-title" if reported else f"facts/{quote(packet_id)}/{quote(condition_id)}"
    return RedirectResponse(f"/missions/{mission_id}/{back}", status_code=303)


def _disputed(console: Console, mission_id: MissionId, packet_id: str, command: DisputeCompletion) -> tuple[str, ...]:
    """Empty if it is disputed now, else why not."""
    standing = {(one.packet_id, one.condition_id) for one in console.runtime.mission(mission_id).facts}
    if (packet_id, command.condition_id) not in standing:
        return (N_("This acceptance does not stand: it was never made, or the stage was opened again since."),)
    decision = console.runtime.submit(mission_id, command)
    return (reasoned(decision.reason),) if isinstance(decision, Refused) else ()


def _fact(
    console: Console, actor: Actor, mission_id: MissionId, named: tuple[str, str], errors: Sequence[str] = ()
) -> FactPage:
    entries = console.histories.of(mission_id)
    mission = console.runtime.mission(mission_id)
    shell = console.shell(lazy_gettext("Fact {name}", name=named[1]), "missions", actor)
    return facts.fact_page(shell, mission, entries, named, check=console.check, errors=errors)


def _journal(console: Console, mission_id: MissionId) -> ReportSources:
    starts = console.journal(mission_id)
    is_case = any(one.mission_id == mission_id for one in console.releases.growth().added)
    unanswered = _unanswered(console, mission_id)
    if starts is None:
        return ReportSources(starts=None, duplicates=None, is_case=is_case, unanswered=unanswered)
    return ReportSources(starts=len(starts), duplicates=repeated_starts(starts), is_case=is_case, unanswered=unanswered)


def _unanswered(console: Console, mission_id: MissionId) -> NoAnswerAction | None:
    """What the robot did where the mission's last question expired."""
    expired = _expired(console, mission_id)
    return console.runtime.handoff(expired).unanswered if expired is not None else None


def _no_answer(console: Console, mission_id: MissionId) -> dict[str, Any] | None:
    """What the robot did where nobody answered, as JSON: intended and measured. None where no question expired."""
    expired = _expired(console, mission_id)
    opened = console.runtime.handoff(expired).opened if expired is not None else None
    if expired is None or opened is None:
        return None
    decoded = (QUESTION.decode(one) for one in console.runtime.stream(handoff_stream(expired)))
    taken = next((event for event in decoded if isinstance(event, NoAnswerTaken)), None)
    return no_answer_outcome(opened, taken, _retreat_for(console, opened))


def _retreat_for(console: Console, opened: HandoffOpened) -> list[RetreatEvent]:
    """The events of the return to a safe point that this question led to, if its zone allows one."""
    if opened.no_answer != "retreat":
        return []
    control = [CONTROL_EVENTS.decode(one) for one in console.runtime.stream(CONTROL)]
    moves = [one for one in control if isinstance(one, RetreatIntended | RetreatStopping | RetreatEnded)]
    intents = [one for one in moves if isinstance(one, RetreatIntended) and one.handoff_id == opened.handoff_id]
    sent = {one.invocation_id for one in intents}
    return [one for one in moves if one.invocation_id in sent]


def _expired(console: Console, mission_id: MissionId) -> HandoffId | None:
    """The mission's last question, if nobody answered it in time."""
    answers = [one.event for one in console.histories.of(mission_id) if isinstance(one.event, HandoffAnswered)]
    return answers[-1].handoff_id if answers and answers[-1].decision == "expired" else None
