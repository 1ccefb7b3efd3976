"""Shapes the stages of a mission in three columns (declared, measured, accepted), and as a graph."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, reasoned, word
from app.i18n.reasons.rendering import beside
from app.i18n.task_texts import task_text
from app.views.measures import Measure, quantity
from app.views.timeline import TimelineEntry
from harness.contracts.effects import Metric
from harness.contracts.events import CommitRejected, EffectDeclared, NodeCommitted
from harness.contracts.ids import NodeId
from harness.contracts.observations import AnySample, Pose
from harness.contracts.protocol import InvocationReport
from harness.contracts.tasks import Node, TaskContract, order
from harness.contracts.verdicts import ConditionResult
from harness.projections.mission import SETTLED, Mission, NodeState

BOX_W, BOX_H, GAP_X, GAP_Y = 132, 50, 26, 16
BUSY = frozenset({"dispatched", "executed", "verifying"})
TELLING = ("distance_m", "frames", "images", "findings", "displacement_m")
NOT_BEGUN, NOT_REACHED = ("pending", "eligible"), N_("not reached")
"""A stage that had not begun when its mission ended stays so."""
NOT_FINISHED = N_("not finished")
GOAL_STATE = {"satisfied": "committed", "pending": "pending", "violated": "failed", "unsafe": "failed"}
NEEDS_EYES = frozenset({"recovering", "escalated", "rejected"})


@dataclass(frozen=True)
class Observed:
    """What is observed now and not stored as an event: the running invocation's report and the latest samples."""

    report: InvocationReport | None = None
    samples: Sequence[AnySample] = ()


@dataclass(frozen=True)
class Acceptance:
    """The gate's newest word on a stage, and the event that carries it."""

    text: str
    tone: str
    href: str


@dataclass(frozen=True)
class Stage:
    """One node: what was declared, what the harness measured, what the gate accepted. `state` picks the colour."""

    node_id: str
    title: str
    state: str
    status: str
    verdict: str
    progress: float | None
    declared: tuple[Measure, ...]
    measured: tuple[Measure, ...]
    accepted: Acceptance
    note: str
    href: str
    selected: bool


@dataclass(frozen=True)
class GraphBox:
    """One node of the drawn graph, in the units of its view box."""

    x: int
    y: int
    title: str
    label: str
    state: str
    href: str
    selected: bool


@dataclass(frozen=True)
class Graph:
    """The task graph as boxes and arrows; `edges` are SVG paths."""

    width: int
    height: int
    boxes: tuple[GraphBox, ...]
    edges: tuple[str, ...]


def stages(
    mission: Mission, entries: Sequence[TimelineEntry], now: Observed, *, selected: str, instant: str = ""
) -> tuple[Stage, ...]:
    """One per node in graph order; none before the contract is compiled. Links keep the `instant` (at=, t= or none)."""
    contract = mission.contract
    if contract is None:
        return ()
    return tuple(
        _stage(
            mission, contract.node(node_id), entries, now=_of_node(mission, node_id, now), chosen=(selected, instant)
        )
        for node_id in order(contract)
    )


def graph(contract: TaskContract, drawn: Sequence[Stage], *, goal: str) -> Graph:
    """Columns by depth, rows by order; the last box is the goal itself."""
    depth: dict[NodeId, int] = {}
    for node_id in order(contract):
        before = [depth[dependency] + 1 for dependency in contract.node(node_id).depends_on]
        depth[node_id] = max(before, default=0)
    columns = max(depth.values()) + 2
    rows = {level: [n for n in depth if depth[n] == level] for level in range(columns - 1)}
    place = {
        node_id: (level * (BOX_W + GAP_X), row * (BOX_H + GAP_Y))
        for level, members in rows.items()
        for row, node_id in enumerate(members)
    }
    end = ((columns - 1) * (BOX_W + GAP_X), 0)
    last = {node_id for node_id in depth if not any(node_id in node.depends_on for node in contract.nodes)}
    edges = [_edge(place[before], place[node.node_id]) for node in contract.nodes for before in node.depends_on]
    edges += [_edge(place[node_id], end) for node_id in sorted(last)]
    boxes = [_box(place[NodeId(stage.node_id)], stage) for stage in drawn]
    boxes.append(
        GraphBox(
            x=end[0],
            y=end[1],
            title="goal",
            label=goal,
            state=GOAL_STATE.get(goal, "waiting"),
            href="#contract",
            selected=False,
        )
    )
    tallest = max(len(members) for members in rows.values())
    return Graph(
        width=columns * (BOX_W + GAP_X) - GAP_X,
        height=tallest * (BOX_H + GAP_Y) - GAP_Y,
        boxes=tuple(boxes),
        edges=tuple(edges),
    )


def to_target_m(node: Node, samples: Sequence[AnySample]) -> float | None:
    """Planar distance from the newest measured pose to the node's target, metres; None if either is missing."""
    target = next((c.effect.target_m for c in node.success_conditions if isinstance(c.effect, Metric)), None)
    poses = [sample for sample in samples if isinstance(sample, Pose)]
    if target is None or not poses:
        return None
    newest = max(poses, key=lambda pose: pose.at_s)
    return hypot(newest.x_m - target[0], newest.y_m - target[1])


def _of_node(mission: Mission, node_id: NodeId, now: Observed) -> Observed:
    """The observations, if they belong to this node's open invocation; else none."""
    invocation = mission.invocation
    if invocation is None or invocation.intent.node_id != node_id:
        return Observed()
    mine = now.report is not None and now.report.identity.request_id == invocation.intent.request_id
    return Observed(report=now.report if mine else None, samples=now.samples)


def _stage(
    mission: Mission, node: Node, entries: Sequence[TimelineEntry], *, now: Observed, chosen: tuple[str, str]
) -> Stage:
    selected, instant = chosen
    state = mission.of(node.node_id)
    verdict = state.verdicts[-1].verdict if state.verdicts else ""
    return Stage(
        node_id=node.node_id,
        title=task_text(node.subgoal, mission.contract),
        state=_colour(state),
        status=_last_status(state) if mission.ended else _status(state, now),
        verdict=verdict,
        progress=now.report.progress.share if now.report else None,
        declared=_declared(state, now),
        measured=_measured(node, state, now),
        accepted=_acceptance(mission, state, entries),
        note=_note(state),
        href=f"/missions/{mission.mission_id}?{instant}{'&' if instant else ''}node={node.node_id}#evidence",
        selected=node.node_id == selected,
    )


def _colour(state: NodeState) -> str:
    if state.status in SETTLED:
        return state.status
    if state.status in BUSY:
        return "running"
    if state.status in NEEDS_EYES:
        return "waiting"
    return "failed" if state.status == "failed" else "pending"


def _status(state: NodeState, now: Observed) -> str:
    if now.report and now.report.status == "running" and state.status == "dispatched":
        return lazy_gettext("running, {share}", share=f"{now.report.progress.share:.0%}")
    return "running" if state.status == "dispatched" else word(state.status)


def _last_status(state: NodeState) -> str:
    """What is true of a stage for ever once its mission has ended: nothing is under way any more."""
    if state.status in NOT_BEGUN:
        return NOT_REACHED
    return NOT_FINISHED if state.status in BUSY | NEEDS_EYES else word(state.status)


def _declared(state: NodeState, now: Observed) -> tuple[Measure, ...]:
    """The provider's own words: of the running invocation, else of the newest packet that says something."""
    if now.report and now.report.status not in ("succeeded", "failed", "cancelled"):
        left = now.report.progress.remaining_m
        return (Measure(name=N_("to go"), value=f"{left:.1f} m"),) if left is not None else ()
    packet = next((one for one in reversed(state.packets) if one.declared or one.receipts), None)
    if packet is None:
        return ()
    kinds: dict[str, int] = {}
    for receipt in packet.receipts:
        kinds[receipt.kind] = kinds.get(receipt.kind, 0) + 1
    leading = sorted(packet.declared, key=lambda name: (_rank(name), name.endswith("_at_s")))
    measures = [Measure(*quantity(name, packet.declared[name])) for name in leading[:1]]
    measures += [Measure(name=_receipts(kind, many), value=str(many)) for kind, many in kinds.items()]
    return tuple(measures[:2])


def _receipts(kind: str, many: int) -> str:
    return (
        lazy_gettext("{kind} receipts", kind=word(kind))
        if many > 1
        else lazy_gettext("{kind} receipt", kind=word(kind))
    )


def _measured(node: Node, state: NodeState, now: Observed) -> tuple[Measure, ...]:
    """What the harness measured itself: the leading quantity of each condition, beside its bound."""
    if state.status == "dispatched":
        distance = to_target_m(node, now.samples)
        return (Measure(name=N_("straight to target"), value=f"{distance:.1f} m"),) if distance is not None else ()
    if not state.verdicts:
        return ()
    return tuple(measure for result in state.verdicts[-1].results for measure in _leading(result))[:2]


def _rank(name: str) -> int:
    return TELLING.index(name) if name in TELLING else len(TELLING)


def _leading(result: ConditionResult) -> tuple[Measure, ...]:
    """The most telling measured quantity: one that people ask for, else one that has a bound, else the first."""
    names = sorted(result.measured, key=lambda one: (_rank(one), one not in result.bounds))
    name = next(iter(names), None)
    if name is None:
        return ()
    label, value = quantity(name, result.measured[name])
    return (Measure(label, value, quantity(name, result.bounds[name])[1] if name in result.bounds else ""),)


def _acceptance(mission: Mission, state: NodeState, entries: Sequence[TimelineEntry]) -> Acceptance:
    for entry in reversed(entries):
        href = f"/missions/{mission.mission_id}/events/{entry.position}"
        match entry.event:
            case NodeCommitted(node_id=state.node_id):
                return Acceptance(text=f"k {state.committed_k}", tone="good", href=href)
            case EffectDeclared(node_id=state.node_id):
                return Acceptance(text=N_("nothing: declared only"), tone="warn", href=href)
            case CommitRejected(node_id=state.node_id, rule=rule):
                return Acceptance(text=lazy_gettext("refused: {rule}", rule=word(rule)), tone="bad", href=href)
            case _:
                continue
    return Acceptance(text=N_("nothing") if mission.ended else N_("not yet"), tone="plain", href="")


def _note(state: NodeState) -> str:
    """Why a stage is not simply going on."""
    if state.waiting_for:
        return reasoned(state.waiting_for)
    if (failed := state.failure) is not None:
        return lazy_gettext(
            "{failure}: {reason}", failure=word(failed.failure), reason=beside(failed.failure, failed.reason)
        )
    if state.attempt > 1 or state.spends:
        attempts = listed(word(spend.action) for spend in state.spends)
        if not attempts:
            return lazy_gettext("attempt {count}", count=state.attempt)
        return lazy_gettext("attempt {count} after {tried}", count=state.attempt, tried=attempts)
    return ""


def _box(place: tuple[int, int], stage: Stage) -> GraphBox:
    return GraphBox(
        x=place[0],
        y=place[1],
        title=word(stage.node_id),
        label=stage.status.split(",")[0],
        state=stage.state,
        href=stage.href,
        selected=stage.selected,
    )


def _edge(start: tuple[int, int], end: tuple[int, int]) -> str:
    x0, y0, x1, y1 = start[0] + BOX_W, start[1] + BOX_H // 2, end[0] - 3, end[1] + BOX_H // 2
    middle = (x0 + x1) // 2
    return f"M{x0} {y0}C{middle} {y0} {middle} {y1} {x1} {y1}"
