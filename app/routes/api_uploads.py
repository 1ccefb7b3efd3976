"""/api/v1/uploads and /api/v1/replays: files in pieces, recordings replayed as missions, clouds imported to maps."""

from typing import Annotated, Any

import msgspec
from fastapi import Query, Request
from starlette.concurrency import run_in_threadpool

from app.acts.uploads import BeginUploadAct, ImportFloorAct, ImportUploadAct, ReplayUploadAct
from app.auth.permissions import Principal
from app.console import Console, ConsoleDep
from app.i18n.reasons import rendering as reasons
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.routes.api_maps import attached
from app.views.uploaded_files import CHUNK_BYTES, ReplayJob, Upload, UploadPart
from app.web.security import PrincipalDep
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.maps import AttachCloud, MapCloud
from harness.contracts.reasons import because
from harness.map_clouds import stored_cloud, stored_floor

PIECE = {"type": "string", "contentMediaType": "application/octet-stream"}
router = api_requests.router("recordings")


@router.get("/uploads", responses=api_requests.answers(schemas.UploadResource, many=True))
def uploads(console: ConsoleDep) -> Any:
    """Files that are here or on their way, newest first."""
    return api_requests.each(_resource, console.uploads.all())


@router.post("/uploads", status_code=201, responses=api_requests.answers(schemas.UploadResource, status=201))
def begin(console: ConsoleDep, principal: PrincipalDep, body: BeginUploadAct) -> Any:
    """Announce a file. Its pieces follow at /uploads/{upload_id}, each of at most `piece_bytes`."""
    actor = principal.acting("drive")
    parts = [UploadPart(name=one.name, size_bytes=one.size_bytes) for one in body.parts]
    upload = console.uploads.begin(body.name, size_bytes=body.size_bytes, by=actor.name, parts=parts)
    return api_requests.plain(_resource(upload))


@router.get("/uploads/{upload_id}", responses=api_requests.answers(schemas.UploadResource))
def upload(console: ConsoleDep, upload_id: str) -> Any:
    """How much of a file is here: where the next piece goes."""
    found = next((one for one in console.uploads.all() if one.upload_id == upload_id), None)
    if found is None:
        raise UnknownName(because("upload_unknown"))
    return api_requests.plain(_resource(found))


@router.post(
    "/uploads/{upload_id}",
    responses=api_requests.answers(schemas.UploadResource),
    openapi_extra={"requestBody": {"required": True, "content": {"application/octet-stream": {"schema": PIECE}}}},
)
async def piece(
    console: ConsoleDep,
    principal: PrincipalDep,
    request: Request,
    upload_id: str,
    offset: Annotated[int, Query(ge=0, le=2**53)],
) -> Any:
    """One piece, where the last one ended. The same piece again changes nothing."""
    actor, body = principal.acting("drive"), await request.body()
    grown = await run_in_threadpool(console.uploads.add, upload_id, offset=offset, piece=body, by=actor.name)
    return api_requests.plain(_resource(grown))


@router.delete("/uploads/{upload_id}", responses=api_requests.answers(schemas.UploadResource, many=True))
def remove(console: ConsoleDep, principal: PrincipalDep, upload_id: str) -> Any:
    """Take a file away, complete or not; a replay that reads it keeps it."""
    principal.acting("drive")
    removed(console, upload_id)
    return api_requests.each(_resource, console.uploads.all())


@router.post(
    "/uploads/{upload_id}/replay", status_code=202, responses=api_requests.answers(schemas.ReplayResource, status=202)
)
def replay(console: ConsoleDep, principal: PrincipalDep, upload_id: str, body: ReplayUploadAct) -> Any:
    """Replay the recording as a mission: it waits for its turn, and ends on the mission's page."""
    return api_requests.plain(replay_resource(replay_job(console, principal, upload_id, body)))


@router.post("/uploads/{upload_id}/cloud", responses=api_requests.answers(MapCloud))
def cloud(console: ConsoleDep, principal: PrincipalDep, upload_id: str, body: ImportUploadAct) -> Any:
    """Split the cloud and attach it; views of that map version show it from now on."""
    decision = imported(console, principal, upload_id, body)
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(decision)


@router.post("/uploads/{upload_id}/map", responses=api_requests.answers(MapCloud))
def floor(console: ConsoleDep, principal: PrincipalDep, upload_id: str, body: ImportFloorAct) -> Any:
    """Show the walls of a floor map (map_server) with a map version; one that has a picture keeps it without
    `replace`."""
    decision = imported_floor(console, principal, upload_id, body)
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(decision)


@router.get("/replays", responses=api_requests.answers(schemas.ReplayResource, many=True))
def replays(console: ConsoleDep) -> Any:
    """Replays of this console since it started, newest first."""
    jobs = console.replays.jobs() if console.replays is not None else ()
    return api_requests.each(replay_resource, jobs)


@router.get("/replays/{job_id}", responses=api_requests.answers(schemas.ReplayResource))
def job(console: ConsoleDep, job_id: str) -> Any:
    """One replay: whether it waits, reads, runs or has ended, and its mission once there is one."""
    if console.replays is None:
        raise UnknownName(because("replay_unknown"))
    return api_requests.plain(replay_resource(console.replays.job(job_id)))


@router.delete("/replays/{job_id}", responses=api_requests.answers(schemas.ReplayResource))
def cancel(console: ConsoleDep, principal: PrincipalDep, job_id: str) -> Any:
    """Take a replay out of the queue, or end it at its next step."""
    principal.acting("drive")
    if console.replays is None:
        raise UnknownName(because("replay_unknown"))
    return api_requests.plain(replay_resource(console.replays.cancel(job_id)))


def replay_job(console: Console, principal: Principal, upload_id: str, act: ReplayUploadAct) -> ReplayJob:
    """The replay that somebody asked for. Raises ContractInvalid where half a target is given, or nothing replays."""
    actor = principal.acting("drive")
    found = console.uploads.whole(upload_id)
    if found.kind != "recording":
        raise ContractInvalid(because("upload_is_no_recording", name=found.name))
    if console.replays is None:
        raise ContractInvalid(because("replays_not_here"))
    if (act.target_x_m is None) != (act.target_y_m is None) or (act.target_x_m is not None and act.place):
        raise ContractInvalid(because("replay_target_partial"), where="target")
    target = (act.target_x_m, act.target_y_m) if act.target_x_m is not None and act.target_y_m is not None else None
    job = ReplayJob(
        job_id=console.fresh(),
        upload_id=upload_id,
        name=found.name,
        by=actor.name,
        state="waiting",
        target_m=target,
        place=act.place,
        topics=act.topics,
        recover=act.recover,
    )
    return console.replays.ask(job, console.uploads.path(found), actor)


def imported(console: Console, principal: Principal, upload_id: str, act: ImportUploadAct) -> MapCloud | Refused:
    """The cloud that was attached, or why not. Raises CloudInvalid for a file that is none."""
    actor = principal.acting("drive")
    found = console.uploads.whole(upload_id)
    if found.kind != "cloud":
        raise ContractInvalid(because("upload_is_no_cloud", name=found.name))
    stored = stored_cloud(
        console.runtime,
        console.uploads.path(found),
        map_version=act.map_version,
        frame=act.frame,
        metres_per_unit=act.metres_per_unit,
    )
    command = AttachCloud(actor=actor, cloud=stored, reason=act.reason)
    return attached(console, command, replace=act.replace)


def imported_floor(console: Console, principal: Principal, upload_id: str, act: ImportFloorAct) -> MapCloud | Refused:
    """The floor map as the picture of its map version, or why not. Raises ContractInvalid for a map that cannot be
    read, is in other units than somebody said, or has this site's places in its walls."""
    actor = principal.acting("drive")
    found = console.uploads.whole(upload_id)
    if found.kind != "map":
        raise ContractInvalid(because("upload_is_no_map", name=found.name))
    stored = stored_floor(
        console.runtime,
        console.uploads.path(found),
        map_version=act.map_version,
        frame=act.frame,
        metres_per_cell=act.metres_per_cell,
        site=console.runtime.site,
    )
    return attached(console, AttachCloud(actor=actor, cloud=stored, reason=act.reason), replace=act.replace)


def removed(console: Console, upload_id: str) -> None:
    """Raises ContractInvalid while a replay reads it, UnknownName for no such file."""
    if console.replays is not None and console.replays.uses(upload_id):
        raise ContractInvalid(because("upload_in_use"))
    console.uploads.remove(upload_id)


def replay_resource(one: ReplayJob) -> schemas.ReplayResource:
    """A replay as the API answers it; its problem in words."""
    return schemas.ReplayResource(
        replay_id=one.job_id,
        upload_id=one.upload_id,
        name=one.name,
        state=one.state,
        mission_id=one.mission_id,
        status=one.status,
        problem=reasons.sentence(one.problem) if one.problem else "",
        problem_code=one.problem.code if isinstance(one.problem, msgspec.Struct) else "",
    )


def _resource(one: Upload) -> schemas.UploadResource:
    return schemas.UploadResource(
        upload_id=one.upload_id,
        name=one.name,
        kind=one.kind,
        size_bytes=one.size_bytes,
        received_bytes=one.received_bytes,
        piece_bytes=CHUNK_BYTES,
    )
