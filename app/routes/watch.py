"""/missions/{id}: one mission as a page, and each region of it by itself."""

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from app.console import ActorDep
from app.instant import InstantDep
from app.rendering import render
from app.views.regions import (
    BudgetRegion,
    ContextsRegion,
    ContractRegion,
    EventsRegion,
    EvidenceRegion,
    FactsRegion,
    FramesRegion,
    GraphRegion,
    HeadRegion,
    InstantRegions,
    MissionPage,
    PlotsRegion,
    RobotRegion,
    SceneRegion,
    StagesRegion,
    TimelineRegion,
)

router = APIRouter(prefix="/missions/{mission_id}")


@router.get("")
def show(instant: InstantDep, actor: ActorDep) -> HTMLResponse:
    names = (f"mission/{instant.mission_id}", f"live/{instant.mission_id}")
    page = MissionPage(
        **instant.regions,
        shell=instant.console.shell(instant.head.goal, "missions", actor, topics=names),
        view=instant.console.doors.key(),
    )
    return render("missions/detail.html", page)


@router.get("/instant")
def whole(instant: InstantDep) -> HTMLResponse:
    """Every region of one instant in one answer, each for its own place in the page."""
    return render("missions/instant.html", InstantRegions(**instant.regions))


@router.get("/head")
def head(instant: InstantDep) -> HTMLResponse:
    return render("missions/_head.html", HeadRegion(**instant.place, head=instant.head))


@router.get("/robot")
def robot(instant: InstantDep) -> HTMLResponse:
    return render("missions/_robot.html", RobotRegion(**instant.place, robot=instant.robot))


@router.get("/stages")
def stages(instant: InstantDep) -> HTMLResponse:
    return render("missions/_stages.html", StagesRegion(**instant.place, stages=instant.stages))


@router.get("/graph")
def graph(instant: InstantDep) -> HTMLResponse:
    return render("missions/_graph.html", GraphRegion(**instant.place, graph=instant.graph))


@router.get("/view")
def view(instant: InstantDep) -> HTMLResponse:
    return render("missions/_view.html", SceneRegion(**instant.place, scene=instant.scene))


@router.get("/timeline")
def timeline(instant: InstantDep) -> HTMLResponse:
    return render("missions/_timeline.html", TimelineRegion(**instant.place, timeline=instant.timeline))


@router.get("/plots")
def plots(instant: InstantDep) -> HTMLResponse:
    return render(
        "missions/_plots.html", PlotsRegion(**instant.place, plots=instant.plots, cursor=instant.cursor.standing)
    )


@router.get("/frames")
def frames(instant: InstantDep) -> HTMLResponse:
    return render("missions/_frames.html", FramesRegion(**instant.place, frames=instant.frames))


@router.get("/facts")
def facts(instant: InstantDep) -> HTMLResponse:
    return render("missions/_facts.html", FactsRegion(**instant.place, facts=instant.facts))


@router.get("/events")
def events(instant: InstantDep) -> HTMLResponse:
    return render(
        "missions/_events.html", EventsRegion(**instant.place, lines=instant.lines, count=len(instant.entries))
    )


@router.get("/evidence")
def evidence(instant: InstantDep) -> HTMLResponse:
    return render("missions/_evidence.html", EvidenceRegion(**instant.place, evidence=instant.evidence))


@router.get("/contexts")
def contexts(instant: InstantDep) -> HTMLResponse:
    return render("missions/_contexts.html", ContextsRegion(**instant.place, contexts=instant.contexts))


@router.get("/contract")
def contract(instant: InstantDep) -> HTMLResponse:
    return render("missions/_contract.html", ContractRegion(**instant.place, contract=instant.contract))


@router.get("/budget")
def budget(instant: InstantDep) -> HTMLResponse:
    return render("missions/_budget.html", BudgetRegion(**instant.place, budget=instant.budget))
