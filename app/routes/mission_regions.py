"""How a mission page is put together from its history, its records and what is observed now."""

from functools import reduce

from app.console import Console
from app.views import missions
from app.views.budgets import budget
from app.views.contexts import contexts, goal_context
from app.views.evidence import evidence
from app.views.missions import MissionPage, Regions
from app.views.stages import Observed, graph, stages
from app.views.timeline import Entry, timeline, until
from harness.contracts.events import Actor
from harness.contracts.ids import MissionId
from harness.projections.mission import Mission, apply


def page_of(console: Console, actor: Actor, mission_id: MissionId, *, at: int | None, node: str) -> MissionPage:
    """The whole page; raises UnknownName."""
    regions = regions_of(console, mission_id, at=at, node=node)
    topics = () if at is not None else (f"mission/{mission_id}", f"live/{mission_id}")
    shell = console.shell(regions.head.goal, "missions", actor, topics=topics)
    return MissionPage(shell=shell, **vars(regions))


def regions_of(console: Console, mission_id: MissionId, *, at: int | None, node: str) -> Regions:
    """The mission as it is now, or as it was when the event at that position had just been appended."""
    entries = console.histories.of(mission_id)
    shown = until(entries, at)
    mission = folded(shown)
    live = None if at is not None or mission.ended else console.runtime.observations(mission_id)
    wanted = node if node in mission.nodes else ""
    now = Observed(report=live.report, samples=live.samples) if live else Observed()
    chosen = missions.chosen_node(mission, wanted)
    drawn = stages(mission, shown, now, selected=chosen)
    title = next((stage.title for stage in drawn if stage.node_id == chosen), chosen)
    verdict = mission.goal_verdict.verdict if mission.goal_verdict else "pending"
    return Regions(
        mission_id=mission_id,
        node=chosen,
        at=at,
        query=missions.query(at=at, node=wanted),
        head=missions.head(mission, shown),
        robot=missions.robot_strip(live.status, live.at_s) if live else None,
        stages=drawn,
        graph=graph(mission.contract, drawn, goal=verdict) if mission.contract else None,
        timeline=timeline(mission_id, entries, at=at, node=wanted),
        evidence=evidence(mission_id, shown, node_id=chosen, title=title, check=console.check),
        contexts=contexts(shown, node_id=chosen, read=console.context, candidates=console.candidates),
        contract=missions.contract_view(mission, goal_context(shown, read=console.context)),
        budget=budget(mission, chosen),
        scene=console.scenes.note(mission_id),
    )


def folded(entries: tuple[Entry, ...]) -> Mission:
    return reduce(apply, (entry.event for entry in entries), Mission())
