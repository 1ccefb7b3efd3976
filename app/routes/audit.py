"""/audit: verify and anchor the log, and read who decided what; /audit/access: who signed in from where."""

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.responses import HTMLResponse, PlainTextResponse

from app.auth.permissions import Principal
from app.console import Console, ConsoleDep
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.i18n.messages import lazy_gettext, reasoned
from app.views import audit
from app.web.rendering import render
from app.web.security import PrincipalDep
from harness.anchors import compared_with_text
from harness.contracts.errors import ContractInvalid, LogDamaged
from harness.contracts.reasons import because
from harness.contracts.stored_commands import command_of

router = APIRouter(prefix="/audit")
SHOWN, WINDOW, SCANNED = 50, 500, 5000
LONGEST_ANCHOR = 4000
Filter = Annotated[str, Query(max_length=200)]
Before = Annotated[int, Query(ge=0, le=2**62)]


@router.get("")
def show(
    console: ConsoleDep,
    principal: PrincipalDep,
    actor: Filter = "",
    kind: Filter = "",
    everything: bool = False,
    before: Before = 0,
    verify: bool = False,
    anchor: Annotated[str, Query(max_length=LONGEST_ANCHOR)] = "",
    anchor_key: Annotated[str, Query(max_length=200)] = "",
) -> HTMLResponse:
    filters = audit.AuditFilter(actor=actor.strip(), kind=kind.strip(), everything=everything)
    given = audit.GivenAnchor(text=anchor.strip(), key=anchor_key.strip())
    return _page(console, principal, filters, given, before=before, verify=verify)


@router.post("/anchors")
async def uploaded(request: Request, console: ConsoleDep, principal: PrincipalDep) -> HTMLResponse:
    """Compare the log with a file of anchors that was kept elsewhere. Nothing is stored."""
    async with request.form(max_files=1, max_fields=4) as form:
        file, key = form.get("anchors"), form.get("anchor_key")
        body = await file.read() if isinstance(file, UploadFile) else b""
    text = body.decode(errors="replace").strip()
    given = audit.GivenAnchor(text=text, key=key.strip() if isinstance(key, str) else "", file=True)
    return await run_in_threadpool(_page, console, principal, audit.AuditFilter(), given, before=0, verify=False)


def _page(
    console: Console,
    principal: Principal,
    filters: audit.AuditFilter,
    given: audit.GivenAnchor,
    *,
    before: int,
    verify: bool,
) -> HTMLResponse:
    decisions, scanned_from = newest_first(console, filters, before=before)
    shell = console.shell("Audit", "audit", principal.actor)
    page = audit.AuditPage(
        shell=shell,
        head=console.head(),
        decisions=tuple(decisions),
        wanted=filters,
        scanned_from=scanned_from,
        found=_log_sum(console) if verify or given.text else audit.Sum(),
        anchor=_compared(console, given),
        keeps_trail=principal.may("trail"),
    )
    return render("audit/index.html", page)


@router.get("/anchor.txt")
def anchor(console: ConsoleDep) -> PlainTextResponse:
    """The head of the log, to be kept elsewhere: the log is tamper-evident up to the last anchor kept."""
    head = console.head()
    return PlainTextResponse(
        f"{head.position} {head.digest}\n",
        headers={"Content-Disposition": f'attachment; filename="anchor-{head.position}.txt"'},
    )


@router.get("/access")
def access(
    console: ConsoleDep,
    principal: PrincipalDep,
    actor: Filter = "",
    kind: Filter = "",
    before: Before = 0,
    verify: bool = False,
) -> HTMLResponse:
    principal.acting("trail")
    store = console.sessions.accounts.store
    entries = store.audit_log(before=before or None, kind=kind.strip(), actor=actor.strip(), limit=SHOWN)
    page = audit.AccessPage(
        shell=console.shell("Access", "audit", principal.actor),
        rows=tuple(
            audit.AuditRow(e.number, e.at_s, e.kind, e.actor, e.role, e.subject, e.detail, e.source) for e in entries
        ),
        wanted=audit.AuditFilter(actor=actor, kind=kind),
        older=entries[-1].number if len(entries) == SHOWN else 0,
        found=_trail_sum(console) if verify else audit.Sum(),
    )
    return render("audit/access.html", page)


def newest_first(
    console: Console, filters: audit.AuditFilter, *, before: int, limit: int = SHOWN
) -> tuple[list[audit.AuditEvent], int]:
    """Matching entries below a position (0: from the head), and the lowest position read. Reads at most SCANNED."""
    upto = before - 1 if before else console.head().position
    floor = max(0, upto - SCANNED)
    found: list[audit.AuditEvent] = []
    while upto > floor and len(found) < limit:
        after = max(floor, upto - WINDOW)
        for stored in reversed(console.runtime.log(after, upto - after)):
            one = audit.entry(stored)
            if filters.fits(one):
                found.append(one)
                if len(found) == limit:
                    return found, one.position
        upto = after
    return found, upto + 1


def _log_sum(console: Console) -> audit.Sum:
    try:
        head = console.runtime.verify()
        forged = console.runtime.audit_snapshots().forged
    except LogDamaged as error:
        return audit.Sum(damage=explained(error))
    if forged:
        return audit.Sum(damage=reasoned(because("snapshot_forged", stream=forged[0])))
    return audit.Sum(
        verified=lazy_gettext(
            "Every hash of the log and of its records was computed again: {count} events, intact.", count=head.position
        ),
        note=_before_commands(console),
    )


def _compared(console: Console, given: audit.GivenAnchor) -> audit.GivenAnchor:
    """The anchors that were given, compared with the log; unchanged where nothing was given.

    Of many, those that do not fit and the newest that does are shown.
    """
    if not given.text:
        return replace(given, problem=N_("The file is empty.")) if given.file else given
    try:
        found = compared_with_text(console.runtime, given.text, key=given.key)
    except ContractInvalid as error:
        return replace(given, problem=explained(error), text="" if given.file else given.text)
    wrong = [one for one in found if one.reason is not None]
    fits = max((one for one in found if one.reason is None), key=lambda one: one.position, default=None)
    listed = (*wrong[:SHOWN], *((fits,) if fits else ()))
    return replace(given, found=listed, total=len(found), text="" if given.file else given.text)


def _before_commands(console: Console) -> str:
    """What an auditor must know of a log that began before commands were stored; empty for any other."""
    upto = 0
    while events := console.runtime.log(upto, WINDOW):
        first = next((one.position for one in events if command_of(one) is not None), None)
        upto = events[-1].position if first is None else first - 1
        if first is not None:
            break
    if not upto:
        return ""
    return lazy_gettext(
        "The first {count} events are a log from before commands were stored: replay uses commands reconstructed "
        "from events there.",
        count=upto,
    )


def _trail_sum(console: Console) -> audit.Sum:
    try:
        entries = console.sessions.accounts.store.verify_trail()
    except LogDamaged as error:
        return audit.Sum(damage=explained(error))
    return audit.Sum(
        verified=lazy_gettext("Every hash of the trail was computed again: {count} entries, intact.", count=entries)
    )
