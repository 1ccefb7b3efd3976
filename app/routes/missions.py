"""/missions: list, watch, start and stop missions."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar

from fastapi import APIRouter, Depends, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.missions import StartMissionAct, StopMissionAct
from app.console import ActorDep, Console, ConsoleDep, FormDep, file_of
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.i18n.messages import lazy_gettext, reasoned
from app.routes.handoff_page import word_of
from app.routes.listing import list_params, listed_page
from app.views import events, forms, missions
from app.views import preview as previews
from app.views.forms import Before, FormOptions, RepeatedMission, StopPage, Wrong
from app.views.list_params import ListParams
from app.views.preview import Preview
from app.views.readings import goal_words, question_view
from app.views.tabbed_list import TabbedList
from app.web.rendering import render
from app.web.security import WITH_MICROPHONE, PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.errors import (
    ContractInvalid,
    GoalNotUnderstood,
    ProviderFailed,
    RecordingUnusable,
    UnknownName,
)
from harness.contracts.events import MissionCreated
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.read_models import MissionItem
from harness.contracts.readings import ReadingQuestion
from harness.contracts.tasks import TaskTemplate
from harness.extra_templates import begin, draft, offered
from harness.projections.mission import Mission
from harness.runtime import Start

router = APIRouter(prefix="/missions")
T = TypeVar("T")
ListParamsDep = Annotated[ListParams, Depends(list_params("mission", "status", "robot", "template"))]


class StartRefused(ContractInvalid):
    """The gate would not start the mission."""

    code = "start_refused"


async def spoken_form(request: Request, console: ConsoleDep, principal: PrincipalDep, typed: FormDep) -> dict[str, str]:
    """The posted form; of a recording that was chosen, its transcript is the goal, whatever template stood there.

    A goal that the person then wrote otherwise is typed, and no longer of the recording. `recording_wrong`: why a
    chosen file is no recording of a goal.
    """
    typed = {name: text for name, text in typed.items() if name != "recording_wrong"}
    recording = await file_of(request, "recording_file")
    if recording:
        principal.acting("drive")
        try:
            transcription = await run_in_threadpool(console.runtime.hear, recording)
        except (RecordingUnusable, ProviderFailed) as error:
            return typed | {"recording": "", "recording_wrong": explained(error)}
        found = {"recording": transcription.recording, "heard": transcription.text, "goal": transcription.text}
        return typed | found | {"template": forms.BY_GOAL}
    if typed.get("recording") and typed.get("goal", "").strip() != typed.get("heard"):
        return typed | {"recording": "", "heard": ""}
    return typed


SpokenFormDep = Annotated[dict[str, str], Depends(spoken_form)]


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, params: ListParamsDep) -> HTMLResponse:
    return render("missions/index.html", listed(console, actor, params))


@router.get("/list")
def listing(console: ConsoleDep, actor: ActorDep, params: ListParamsDep) -> HTMLResponse:
    return render("missions/_list.html", listed(console, actor, params))


def listed(console: Console, actor: Actor, params: ListParams) -> TabbedList[MissionItem]:
    """One page of the list, with what its tabs would show."""
    shell = console.shell("Missions", "missions", actor)
    return listed_page(console.lists, missions.LIST, shell, params, console.lists.missions)


@router.get("/new")
def new(request: Request, console: ConsoleDep, actor: ActorDep, rerun_of: str = "") -> HTMLResponse:
    typed = dict(request.query_params)
    if rerun_of:
        typed = _as_before(console, MissionId(rerun_of)) | typed
    return _form(console, actor, typed)


@router.post("/preview")
def preview(console: ConsoleDep, principal: PrincipalDep, actor: ActorDep, typed: SpokenFormDep) -> HTMLResponse:
    """The form with the contract it would be compiled to; nothing is written but a recording, if one was chosen."""
    principal.acting("drive")
    drafted = _compiled(console, actor, typed, lambda order: draft(console.runtime, order))
    if isinstance(drafted, ReadingQuestion):
        return _form(console, actor, typed, question=drafted)
    if isinstance(drafted, tuple):
        return _form(console, actor, typed, wrong=drafted)
    return _form(console, actor, typed, content=previews.preview(drafted, console.runtime.site))


@router.post("")
def start(console: ConsoleDep, actor: ActorDep, typed: SpokenFormDep) -> Response:
    key = typed.get("key", "")
    outcome = _compiled(console, actor, typed, lambda order: console.keys.once(key, lambda: started(console, order)))
    if isinstance(outcome, ReadingQuestion):
        return _form(console, actor, typed, question=outcome)
    if isinstance(outcome, tuple):
        return _form(console, actor, typed, wrong=outcome)
    return RedirectResponse(f"/missions/{outcome}", status_code=303)


def ordered(console: Console, actor: Actor, act: StartMissionAct, *, channel: str) -> Start:
    """What is asked for, over which channel; raises UnknownName for a robot that this console does not have."""
    robot_id = console.robot(act.robot_id)
    return dataclasses.replace(act.model_copy(update={"robot_id": robot_id}).to_command(actor), channel=channel)


def started(console: Console, order: Start) -> MissionId:
    """The new mission's id; raises UnknownName, ContractInvalid or StartRefused."""
    decision = begin(console.runtime, order)
    if isinstance(decision, Refused):
        raise StartRefused(decision.reason, where=decision.rule)
    return next(event.mission_id for event in decision.events if isinstance(event, MissionCreated))


@router.get("/{mission_id}/stop")
def stopping(console: ConsoleDep, actor: ActorDep, mission_id: MissionId) -> HTMLResponse:
    return render("missions/stop.html", _stop_page(console, actor, mission_id, errors=()))


@router.post("/{mission_id}/stop")
def stop(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, typed: FormDep) -> Response:
    act = StopMissionAct.from_form(typed)
    if isinstance(act, tuple):
        errors = tuple(one.text for one in act)
        return render("missions/stop.html", _stop_page(console, actor, mission_id, errors=errors), status=422)
    decision = console.runtime.submit(mission_id, act.to_command(actor))
    if isinstance(decision, Refused):
        page = _stop_page(console, actor, mission_id, errors=(reasoned(decision.reason),))
        return render("missions/stop.html", page, status=409)
    return RedirectResponse(f"/missions/{mission_id}", status_code=303)


@router.get("/{mission_id}/events/{position}")
def event(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, position: int) -> HTMLResponse:
    entries = console.histories.of(mission_id)
    shell = console.shell(lazy_gettext("Event {position}", position=position), "missions", actor)
    return render("missions/event.html", events.event_page(shell, mission_id, entries, position=position))


def _offered(console: Console, typed: dict[str, str]) -> tuple[TaskTemplate, ...]:
    """What the chosen robot can be asked: the templates of its current configuration, and those beside H_0."""
    return offered(console.runtime, RobotId(typed.get("robot_id") or console.robot()))


def _template(console: Console, typed: dict[str, str]) -> TaskTemplate | None:
    return next((one for one in _offered(console, typed) if one.name == typed.get("template")), None)


def _compiled(
    console: Console, actor: Actor, typed: dict[str, str], act: Callable[[Start], T]
) -> T | tuple[Wrong, ...] | ReadingQuestion:
    """What comes of the order that the form makes, what is wrong with the form, or what the person is asked."""
    if typed.get("recording_wrong"):
        return (Wrong("recording_file", typed["recording_wrong"]),)
    if typed.get("rerun_of"):
        console.runtime.mission(MissionId(typed["rerun_of"]))
    try:
        submitted = StartMissionAct.from_form(typed, template=_template(console, typed), robots=console.robots)
        return submitted if isinstance(submitted, tuple) else act(ordered(console, actor, submitted, channel="page"))
    except GoalNotUnderstood as error:
        return error.question
    except (UnknownName, ContractInvalid) as error:
        return (_beside(console, typed, error),)


def _beside(console: Console, typed: dict[str, str], error: UnknownName | ContractInvalid) -> Wrong:
    template = _template(console, typed)
    return forms.about_field(error, typed, template) if template else Wrong("", explained(error))


def _as_before(console: Console, mission_id: MissionId) -> dict[str, str]:
    """The form as it was filled in for a mission; parameters that its template has lost since are left out."""
    mission = console.runtime.mission(mission_id)
    typed = {"robot_id": str(mission.robot_id), "template": mission.template, "goal": mission.goal}
    template = _template(console, typed)
    if template is None or mission.contract is None:
        return typed
    return typed | forms.chosen_before(mission.contract, template)


def _again(console: Console, typed: dict[str, str]) -> RepeatedMission | None:
    if not typed.get("rerun_of"):
        return None
    mission = console.runtime.mission(MissionId(typed["rerun_of"]))
    done = ("committed", "superseded")
    return RepeatedMission(
        mission_id=mission.mission_id,
        goal=goal_words(mission),
        status=mission.status,
        unaccepted=tuple(name for name, node in mission.nodes.items() if node.status not in done),
    )


def _form(
    console: Console,
    actor: Actor,
    typed: dict[str, str],
    *,
    wrong: Sequence[Wrong] = (),
    content: Preview | None = None,
    question: ReadingQuestion | None = None,
) -> HTMLResponse:
    """The form again; 422 where something must be corrected, or a reading confirmed."""
    robots = console.robots
    robot_id = typed.get("robot_id") or console.robot()
    page = forms.start_page(
        console.shell(N_("Start a mission"), "missions", actor),
        FormOptions(_offered(console, typed), console.runtime.site.places, robots),
        typed,
        key=typed.get("key") or console.sessions.key(),
        wrong=wrong,
        again=_again(console, typed),
        ahead=[Before(one.mission_id, goal_words(one), one.status) for one in waiting_line(console, robot_id)],
        preview=content,
        reading=question_view(question) if question else None,
        wake_phrase=next(iter(console.runtime.site.wake_phrases), "").title(),
    )
    answer = render("missions/new.html", page, status=422 if wrong or question else 200)
    answer.headers["permissions-policy"] = WITH_MICROPHONE
    return answer


def waiting_line(console: Console, robot_id: str) -> list[Mission]:
    """Missions of a robot that are not over, in the order in which it does them: oldest first."""
    mine = (one for one in console.open_missions() if one.robot_id == robot_id and not one.replay)
    return list(reversed(list(mine)))


def _stop_page(console: Console, actor: Actor, mission_id: MissionId, *, errors: tuple[str, ...]) -> StopPage:
    mission = console.runtime.mission(mission_id)
    return StopPage(
        shell=console.shell(lazy_gettext("Stop {robot_id}", robot_id=mission.robot_id), "missions", actor),
        mission_id=mission_id,
        robot_id=mission.robot_id,
        goal=goal_words(mission),
        status=mission.status,
        robot=word_of(console, mission.robot_id),
        reasons=forms.STOP_REASONS,
        errors=errors,
    )
