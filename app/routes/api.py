"""/api/v1/missions: preview, start, stop, pause, resume, list, show, follow. JSON in, JSON or a problem out."""

from typing import Annotated, Any

import msgspec
from fastapi import Query, Request, Response
from starlette.concurrency import run_in_threadpool

from app.acts.base import Act
from app.acts.missions import ACTS, DisputeCompletionAct, StartMissionAct
from app.console import ActorDep, Console, ConsoleDep
from app.i18n.reasons import rendering as reasons
from app.routes import api_mission_schemas as mission_schemas
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.routes.missions import ordered, started
from app.views.mission_json import mission_outcome
from app.views.preview import preview as previewed
from app.views.readings import reading_json
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import MissionId
from harness.contracts.read_models import MissionItem
from harness.contracts.readings import Reading
from harness.extra_templates import draft

WAV = {"type": "string", "contentMediaType": "audio/wav"}

router = api_requests.router("missions")


@router.get("/missions", responses=api_requests.answers(mission_schemas.MissionSummary, many=True))
def missions(
    console: ConsoleDep,
    response: Response,
    request: api_requests.ListRequestDep,
    status: api_requests.Facet = "",
    robot: api_requests.Facet = "",
    template: api_requests.Facet = "",
) -> Any:
    """Missions in short, newest first. The Link header leads to the next page, whatever is started meanwhile."""
    facets = {"status": status, "robot": robot, "template": template}
    found = api_requests.listed(response, console.lists.missions, "mission", "/missions", facets, request)
    return api_requests.each(summary, found)


@router.get("/missions/{mission_id}", responses=api_requests.answers(mission_schemas.MissionOutcome))
def mission(console: ConsoleDep, mission_id: MissionId) -> Any:
    """The object that `regen mission run --json` prints."""
    return outcome(console, mission_id)


@router.post("/missions", status_code=201, responses=api_requests.answers(mission_schemas.MissionOutcome, status=201))
def start(console: ConsoleDep, actor: ActorDep, body: StartMissionAct) -> Any:
    """Compile the goal to a contract and start it; nothing is written if that fails."""
    return outcome(console, started(console, ordered(console, actor, body, channel="api")))


@router.post(
    "/recordings",
    status_code=201,
    responses=api_requests.answers(mission_schemas.RecordingHeard, status=201),
    openapi_extra={"requestBody": {"required": True, "content": {"audio/wav": {"schema": WAV}}}},
)
async def recording(console: ConsoleDep, principal: PrincipalDep, request: Request) -> Any:
    """Store a spoken goal and write down what it says: a WAV, 16-bit mono, 8 to 48 kHz, at most 30 s and 1 MiB.

    Nothing starts. POST /missions with its digest as `recording` starts what it says; where two decodings differ, or
    not all of it is understood, that is refused with the reading to confirm.
    """
    principal.acting("drive")
    transcription = await run_in_threadpool(console.runtime.hear, await request.body())
    return api_requests.plain(mission_schemas.as_answered(transcription))


@router.post("/missions/preview", responses=api_requests.answers(mission_schemas.MissionPreview))
def preview(console: ConsoleDep, principal: PrincipalDep, body: StartMissionAct) -> Any:
    """The contract that the same request would start, with its configuration, highest risk and longest time.

    Nothing is written; what could not be started fails as starting it would.
    """
    order = ordered(console, principal.acting("drive"), body, channel="api")
    contract = draft(console.runtime, order)
    content = previewed(contract, console.runtime.site)
    found = mission_schemas.MissionPreview(
        robot_id=order.robot_id,
        configuration=console.runtime.current_configuration_id(order.robot_id),
        highest_risk=content.highest_risk,
        longest_s=content.longest_s,
        stages=tuple(one.node_id for one in content.stages),
        contract=contract,
        reading=msgspec.convert(reading_json(contract.goal.text, contract.reading), mission_schemas.ReadingResource)
        if isinstance(contract.reading, Reading)
        else None,
    )
    return api_requests.plain(found)


@router.post(
    "/missions/{mission_id}/facts/{condition_id}/dispute",
    responses=api_requests.answers(mission_schemas.MissionOutcome),
)
def dispute(
    console: ConsoleDep, actor: ActorDep, mission_id: MissionId, condition_id: str, body: DisputeCompletionAct
) -> Any:
    """Say that an accepted completion is wrong: it counts as false, and nothing is deleted."""
    return _submitted(console, actor, mission_id, body, condition_id=condition_id)


@router.get("/missions/{mission_id}/events", responses=api_requests.answers(schemas.LogEvent, many=True))
def events(
    console: ConsoleDep,
    mission_id: MissionId,
    after: Annotated[int, Query(ge=0, le=2**53)] = 0,
    limit: Annotated[int, Query(ge=1, le=10_000)] = 10_000,
) -> Any:
    """Events after a position, in order, with their places in the hash chain."""
    later = [entry for entry in console.histories.of(mission_id) if entry.position > after]
    return api_requests.plain(later[:limit])


def summary(one: MissionItem) -> mission_schemas.MissionSummary:
    return mission_schemas.MissionSummary(
        mission_id=one.mission_id,
        robot_id=one.robot_id,
        goal=one.goal,
        template=one.template,
        status=one.status,
        **reasons.stated("stage", one.stage),
        goal_verdict=one.verdict or None,
        state_version=one.k,
        handoff_id=one.handoff_id or None,
        began_s=one.began_s,
        ended_s=one.ended_s,
        recovery=mission_schemas.RecoverySpend(spent=one.spent, remaining=max(one.budget - one.spent, 0)),
    )


def outcome(console: Console, mission_id: MissionId) -> dict[str, Any]:
    """One mission as JSON; raises UnknownName."""
    return mission_outcome(
        console.runtime.mission(mission_id), console.histories.of(mission_id), console.journal(mission_id)
    )


def _submitted(console: Console, actor: Actor, mission_id: MissionId, act: Act, **named: str) -> Any:
    decision = console.runtime.submit(mission_id, act.to_command(actor, **named))
    return api_requests.refusal(decision) if isinstance(decision, Refused) else outcome(console, mission_id)


def _act() -> api_requests.Handler:
    def act(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, body: Any) -> Any:
        return _submitted(console, actor, mission_id, body)

    return act


api_requests.post_acts(router, "/missions/{mission_id}", ACTS, _act, answered=mission_schemas.MissionOutcome)
