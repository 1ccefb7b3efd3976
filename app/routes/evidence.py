"""/evidence: the list of all evidence, and blobs by digest, verified at each read and served with a safe type."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.erasures import EraseBlobAct
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.messages import lazy_gettext, reasoned
from app.routes.listing import list_params
from app.views import evidence_list
from app.views.evidence import Unsound, unsound
from app.views.evidence_list import BlobPage
from app.views.forms import Wrong
from app.views.list_params import ListParams
from app.views.marked_pictures import MarkedPicture, marked_pictures
from app.views.measurement_drawing import measurement_drawing
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.erasure_events import medium_of
from harness.contracts.errors import BlobDamaged, UnknownName
from harness.contracts.ids import Digest, MissionId, sha256
from harness.contracts.read_models import ListQuery
from harness.contracts.reasons import because
from harness.projections.evidence_list import BLOB_SIGNS

router = APIRouter(prefix="/evidence")
ListParamsDep = Annotated[
    ListParams, Depends(list_params("evidence", "kind", "source", "node", "verdict", "decision", "mission"))
]
DigestPath = Annotated[str, Path(pattern="^[0-9a-f]{64}$")]
USES = 100
MAGIC: tuple[tuple[bytes, str, str], ...] = (
    (b"\xff\xd8\xff", "image/jpeg", "jpg"),
    (b"\x89PNG\r\n\x1a\n", "image/png", "png"),
)
IMAGES = tuple(magic for magic, _, _ in MAGIC)


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, params: ListParamsDep) -> HTMLResponse:
    found = console.lists.evidence(params.query)
    page = evidence_list.evidence_page(
        console.shell("Evidence", "evidence", actor),
        params,
        found.items,
        found.following,
        found=console.lists.found(params.query, found),
        tallies=console.lists.tallies("evidence"),
    )
    return render("evidence/index.html", page)


@router.get("/{digest}/about")
def about(console: ConsoleDep, actor: ActorDep, digest: DigestPath) -> HTMLResponse:
    """The blob read and hashed now, and every packet that refers to it. 404 for one that nothing refers to."""
    return render("evidence/about.html", _about(console, actor, digest))


@router.post("/{digest}/erase")
def erase(console: ConsoleDep, principal: PrincipalDep, digest: DigestPath, typed: FormDep) -> Response:
    """Erase a photograph or a voice for good, with a reason."""
    actor = principal.acting("erase")
    act = EraseBlobAct.from_form(typed)
    if isinstance(act, tuple):
        return render("evidence/about.html", _about(console, actor, digest, wrong=act), status=422)
    decision = console.runtime.erase(Digest(digest), reason=act.reason)
    if isinstance(decision, Refused):
        wrong = (Wrong("", reasoned(decision.reason)),)
        return render("evidence/about.html", _about(console, actor, digest, wrong=wrong), status=409)
    return RedirectResponse(f"/evidence/{digest}/about", status_code=303)


def _about(console: Console, actor: Actor, digest: str, *, wrong: tuple[Wrong, ...] = ()) -> BlobPage:
    uses = ListQuery(listing="evidence", words=(digest[:BLOB_SIGNS],), limit=USES)
    rows = [one for one in console.lists.evidence(uses).items if one.blob == digest]
    if not rows:
        raise UnknownName(because("blob_not_cited", digest=digest[:16]))
    broken: Unsound | None = None
    try:
        body = console.runtime.blob(Digest(digest))
    except BlobDamaged as error:
        body, broken = b"", unsound(error)
    shell = console.shell(lazy_gettext("Blob {name}", name=digest[:8]), "evidence", actor)
    return BlobPage(
        shell=shell,
        blob=digest,
        broken=broken,
        size=len(body),
        media_type="" if broken else kind_of(body)[0],
        rows=tuple(rows),
        drawing=measurement_drawing(body, console.runtime.site, read=console.runtime.blob) if body else None,
        marked=_marked(console, digest, rows[0].mission_id) if body.startswith(IMAGES) else None,
        erasable=medium_of(body) is not None and "erase" in shell.may,
        wrong=wrong,
    )


@router.get("/{digest}")
def show(console: ConsoleDep, digest: DigestPath) -> Response:
    """Pictures inline, WAV to listen to, everything else as a download. 404 if the bytes do not match."""
    body = console.runtime.blob(Digest(digest))
    media_type, suffix, inline = kind_of(body)
    disposition = "inline" if inline else "attachment"
    headers = {
        "Content-Disposition": f'{disposition}; filename="{digest[:16]}.{suffix}"',
        "Content-Security-Policy": "default-src 'none'; sandbox",
        "X-Verified-SHA256": sha256(body),
    }
    return Response(body, media_type=media_type, headers=headers)


def _marked(console: Console, digest: str, mission_id: str) -> MarkedPicture | None:
    """What the newest analysis of its mission found in a picture."""
    entries = console.histories.of(MissionId(mission_id))
    return marked_pictures(entries, console.runtime.blob).get(digest)


def kind_of(body: bytes) -> tuple[str, str, bool]:
    """(media type, suffix, may be shown inline), from the first bytes alone."""
    for magic, media_type, suffix in MAGIC:
        if body.startswith(magic):
            return media_type, suffix, True
    if body[:4] == b"RIFF" and body[8:12] == b"WAVE":
        return "audio/wav", "wav", True
    return (
        ("application/json", "json", False) if body[:1] in (b"{", b"[") else ("application/octet-stream", "bin", False)
    )
