"""/recordings: upload a recording or a map, replay it as a mission, and read what audits of recordings found."""

from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar
from urllib.parse import quote

from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.base import ActModel
from app.acts.uploads import ImportFloorAct, ImportUploadAct, ReplayUploadAct
from app.console import ActorDep, Console, ConsoleDep, FormDep, files_of
from app.i18n.languages import explained
from app.i18n.messages import reasoned
from app.routes.api_uploads import imported, imported_floor, removed, replay_job
from app.views.bag_audits import AuditShown, counted
from app.views.forms import Wrong
from app.views.recordings import RecordingsPage, ReplayRow
from app.views.uploaded_files import CHUNK_BYTES, UploadPart
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.errors import CloudInvalid, ContractInvalid
from harness.contracts.maps import MapCloud, map_stream

Given = TypeVar("Given", bound=ActModel)
router = APIRouter(prefix="/recordings")


@router.get("")
def index(
    console: ConsoleDep, actor: ActorDep, imported_to: Annotated[str, Query(max_length=200)] = ""
) -> HTMLResponse:
    return render("recordings/index.html", page_of(console, actor, imported_to=imported_to))


@router.get("/replays")
def replays(console: ConsoleDep, actor: ActorDep) -> HTMLResponse:
    return render("recordings/_replays.html", page_of(console, actor))


@router.post("")
async def upload(request: Request, console: ConsoleDep, principal: PrincipalDep) -> Response:
    """A small file at once, for a browser without scripts; with scripts it comes in pieces through the API."""
    actor = principal.acting("drive")
    files = await files_of(request, "file")
    try:
        await run_in_threadpool(_stored, console, actor, files)
    except ContractInvalid as error:
        return render("recordings/index.html", page_of(console, actor, (explained(error),)), status=422)
    return RedirectResponse("/recordings", status_code=303)


@router.post("/replays/{job_id}/cancel")
def cancel(console: ConsoleDep, principal: PrincipalDep, job_id: str) -> Response:
    principal.acting("drive")
    if console.replays is not None:
        console.replays.cancel(job_id)
    return RedirectResponse("/recordings", status_code=303)


@router.post("/{upload_id}/replay")
def replay(console: ConsoleDep, principal: PrincipalDep, upload_id: str, typed: FormDep) -> Response:
    act = ReplayUploadAct.from_form(typed)
    return _done(
        console, principal.acting("drive"), act, lambda given: replay_job(console, principal, upload_id, given)
    )


@router.post("/{upload_id}/cloud")
def cloud(console: ConsoleDep, principal: PrincipalDep, upload_id: str, typed: FormDep) -> Response:
    act = ImportUploadAct.from_form(typed)
    return _done(console, principal.acting("drive"), act, lambda given: imported(console, principal, upload_id, given))


@router.post("/{upload_id}/map")
def floor(console: ConsoleDep, principal: PrincipalDep, upload_id: str, typed: FormDep) -> Response:
    act = ImportFloorAct.from_form(typed)
    return _done(
        console, principal.acting("drive"), act, lambda given: imported_floor(console, principal, upload_id, given)
    )


@router.post("/{upload_id}/remove")
def remove(console: ConsoleDep, principal: PrincipalDep, upload_id: str) -> Response:
    actor = principal.acting("drive")
    try:
        removed(console, upload_id)
    except ContractInvalid as error:
        return render("recordings/index.html", page_of(console, actor, (explained(error),)), status=409)
    return RedirectResponse("/recordings", status_code=303)


def page_of(console: Console, actor: Actor, errors: Sequence[str] = (), *, imported_to: str = "") -> RecordingsPage:
    jobs = console.replays.jobs() if console.replays is not None else ()
    return RecordingsPage(
        shell=console.shell("Recordings", "recordings", actor),
        uploads=console.uploads.all(),
        replays=tuple(ReplayRow(one) for one in jobs),
        audits=tuple(AuditShown(one, counted(one)) for one in console.audits()),
        limit_bytes=console.uploads.most_bytes,
        map_version=console.runtime.site.map_version,
        imported=imported_to if imported_to and console.runtime.fold(map_stream(imported_to)).cloud is not None else "",
        errors=tuple(errors),
    )


def _stored(console: Console, actor: Actor, files: Sequence[tuple[str, bytes]]) -> None:
    body = b"".join(content for _, content in files)
    parts = [UploadPart(name=name, size_bytes=len(content)) for name, content in files] if len(files) > 1 else []
    upload = console.uploads.begin(files[0][0] if files else "", size_bytes=len(body), by=actor.name, parts=parts)
    for offset in range(0, len(body), CHUNK_BYTES):
        piece = body[offset : offset + CHUNK_BYTES]
        console.uploads.add(upload.upload_id, offset=offset, piece=piece, by=actor.name)


def _done(console: Console, actor: Actor, act: Given | tuple[Wrong, ...], do: Callable[[Given], object]) -> Response:
    """The page again with what was wrong or why it was refused, or the page as it is now."""
    if isinstance(act, tuple):
        return render("recordings/index.html", page_of(console, actor, [one.text for one in act]), status=422)
    try:
        decision = do(act)
    except (CloudInvalid, ContractInvalid) as error:
        return render("recordings/index.html", page_of(console, actor, (explained(error),)), status=422)
    if isinstance(decision, Refused):
        return render("recordings/index.html", page_of(console, actor, (reasoned(decision.reason),)), status=409)
    where = f"?imported_to={quote(decision.map_version)}" if isinstance(decision, MapCloud) else ""
    return RedirectResponse(f"/recordings{where}", status_code=303)
