"""Shapes a mission before it is started: graph, budgets, risks, places on the map, conditions."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, word
from app.views.places import SiteMap, site_map
from app.views.readings import ReadingView, reading_view
from app.views.stages import Acceptance, Graph, Stage, graph
from harness.contracts.effects import Metric
from harness.contracts.places import Site
from harness.contracts.readings import Reading
from harness.contracts.tasks import Node, RecoveryLimits, TaskContract, order

RISKS = ("low", "medium", "high")


@dataclass(frozen=True)
class PlaceMark:
    """A place that the contract names, on the map."""

    name: str
    x: float
    y: float


@dataclass(frozen=True)
class Preview:
    """A contract that was compiled and not stored. `longest_s` is the sum of the stages' time limits."""

    contract: TaskContract
    graph: Graph
    stages: tuple[Node, ...]
    highest_risk: str
    longest_s: float
    map: SiteMap
    marks: tuple[PlaceMark, ...]
    reading: ReadingView | None = None


def preview(contract: TaskContract, site: Site) -> Preview:
    """The preview of a compiled contract."""
    nodes = tuple(contract.node(name) for name in order(contract))
    return Preview(
        contract=contract,
        graph=graph(contract, [_pending(node) for node in nodes], goal="pending"),
        stages=nodes,
        highest_risk=max((node.risk for node in nodes), key=RISKS.index),
        longest_s=sum(node.timeout_s for node in nodes),
        map=site_map(site),
        marks=_marks(contract, site, nodes),
        reading=reading_view(contract.goal.text, contract.reading) if isinstance(contract.reading, Reading) else None,
    )


def allowed(limits: RecoveryLimits) -> str:
    """What a stage may spend on recovery, in words."""
    spends = {
        N_("look again"): limits.re_perceive,
        N_("adjust the view"): limits.adjust_view,
        "retry": limits.retry,
        N_("plan again"): limits.local_replan,
        N_("switch the skill"): limits.switch_skill,
    }
    counts = listed(
        lazy_gettext("{action} {count}", action=name, count=count) for name, count in spends.items() if count
    )
    return lazy_gettext("{total} in all: {allowed}", total=limits.total, allowed=counts) if limits.total else "none"


def _marks(contract: TaskContract, site: Site, nodes: Sequence[Node]) -> tuple[PlaceMark, ...]:
    """Targets of the stages, named by the place that lies there, else by their stage."""
    found: dict[tuple[float, float], str] = {}
    names = {place.approach_m: place.name for place in site.places}
    for node in nodes:
        for condition in node.success_conditions:
            if isinstance(condition.effect, Metric) and condition.effect.frame == site.frame:
                at = condition.effect.target_m
                found.setdefault(at, names.get(at, node.node_id.replace("_", " ")))
    return tuple(PlaceMark(name=name, x=at[0], y=-at[1]) for at, name in found.items())


def _pending(node: Node) -> Stage:
    return Stage(
        node_id=node.node_id,
        title=word(node.node_id),
        state="pending",
        status=lazy_gettext("risk {risk}", risk=node.risk),
        verdict="",
        progress=None,
        declared=(),
        measured=(),
        accepted=Acceptance(text="", tone="plain", href=""),
        note="",
        href=f"#stage-{node.node_id}",
        selected=False,
    )
