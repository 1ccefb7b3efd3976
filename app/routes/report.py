"""/missions/{id}/report: what became of a mission, to print or as JSON; /log: its events; /facts: one, to its root."""

from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.responses import HTMLResponse, JSONResponse

from app.console import ActorDep, Console, ConsoleDep
from app.rendering import render
from app.views import events, facts, report
from app.views.outcome import mission_outcome
from app.views.report import Journal
from harness.contracts.ids import Digest, MissionId

router = APIRouter(prefix="/missions/{mission_id}")
LONGEST = 200


@router.get("/report")
def printable(console: ConsoleDep, actor: ActorDep, mission_id: MissionId) -> HTMLResponse:
    entries = console.histories.of(mission_id)
    mission = console.runtime.mission(mission_id)
    broken = {blob: console.check(Digest(blob)) for blob, _, _ in report.pictures(entries)}
    shell = console.shell(f"Report: {mission.goal}", "missions", actor)
    page = report.report_page(shell, mission, entries, _journal(console, mission_id), broken)
    return render("missions/report.html", page)


@router.get("/report.json")
def machine_readable(console: ConsoleDep, mission_id: MissionId) -> JSONResponse:
    """The object that `regen mission run --json` prints, with timings, and the place in the log it stands at."""
    entries = console.histories.of(mission_id)
    mission = console.runtime.mission(mission_id)
    body: dict[str, Any] = mission_outcome(mission, entries, console.starts(mission_id))
    body["timings"] = [vars(one) for one in report.timings(mission, entries)]
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
    entries = console.histories.of(mission_id)
    mission = console.runtime.mission(mission_id)
    shell = console.shell(f"Fact {condition_id}", "missions", actor)
    page = facts.fact_page(shell, mission, entries, (packet_id, condition_id), check=console.check)
    return render("missions/fact.html", page)


def _journal(console: Console, mission_id: MissionId) -> Journal:
    starts = console.starts(mission_id)
    if starts is None:
        return Journal(starts=None, duplicates=None)
    return Journal(starts=len(starts), duplicates=len(starts) - len({one.request_id for one in starts}))
