"""Shapes where an exploring mission looked next: what was considered, its gain and cost, the choice and its reason.

Gain and cost are the proposer's own basis: metres of unknown edge, metres of known way. What came of it is measured.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist

from app.i18n.messages import lazy_gettext, reasoned, word
from app.i18n.reasons.rendering import beside
from app.views.explored_floor import ExploredFloor, explored_floor
from app.views.missions import MissionHeader, head
from app.views.shell import Shell
from app.views.stages import Observed, Stage, stages
from app.views.timeline import TimelineEntry
from harness.contracts import exploration
from harness.contracts.errors import UnknownName
from harness.contracts.ids import NodeId
from harness.contracts.reasons import because
from harness.contracts.revision_events import GraphRevised
from harness.projections.exploration import ExplorationDecision, decisions, updates
from harness.projections.mission import Mission, NodeState


@dataclass(frozen=True)
class ChoiceRecords:
    """What was stored of one choice: both records, and the maps before and after the way there; None: not there."""

    question: exploration.TargetQuestion | None = None
    answer: exploration.TargetAnswer | None = None
    before: exploration.GridMap | None = None
    after: exploration.GridMap | None = None


@dataclass(frozen=True)
class ChoiceRow:
    """One choice in the list, with what came of its leg: declared, measured, accepted; or why it was given up."""

    number: int
    leg: str
    href: str
    x_m: float
    y_m: float
    planner: str
    overruled: bool
    stage: Stage
    given_up: str
    opened_m2: float | None
    selected: bool


@dataclass(frozen=True)
class ChoiceDetail:
    """One choice with all that belongs to it. `position` is the event that made it part of the contract.

    `said` is what the proposer wanted, `refused` why the harness did not; `known` what earlier targets had shown.
    """

    row: ChoiceRow
    reason: str
    said: str
    refused: str
    at_s: float | None
    k: int
    position: int | None
    edges: tuple[exploration.Frontier, ...]
    target_m: tuple[float, float]
    known: tuple[str, ...]
    left: int
    longest_way_m: float
    route_m: float
    image: str
    map_before: str
    map_after: str
    question: str
    answer: str
    recorded: bool
    look: Stage | None
    change: exploration.MapUpdate | None
    floor: ExploredFloor | None


@dataclass(frozen=True)
class ChoicesRegion:
    """Every choice so far, oldest first, and one of them in full: the one that is asked for, else the newest.

    It always follows the newest event: `at` is None. `query` keeps what is asked for.
    """

    mission_id: str
    at: None
    query: str
    choices: tuple[ChoiceRow, ...]
    shown: ChoiceDetail | None


@dataclass(frozen=True)
class ExplorationPage(ChoicesRegion):
    """The choices inside the shell of a page."""

    shell: Shell
    head: MissionHeader


@dataclass(frozen=True)
class _ChoiceHistory:
    """What a mission's own history says of its choices: every stage by name, every map by the leg it follows."""

    mission: Mission
    entries: Sequence[TimelineEntry]
    stages: Mapping[str, Stage]
    maps: Mapping[NodeId, exploration.MapUpdate]


def shown_of(mission: Mission, leg: str) -> ExplorationDecision | None:
    """The choice that the page shows in full. Raises UnknownName for a leg that was never chosen."""
    made = decisions(mission) if mission.contract else ()
    found = next((one for one in made if one.leg == leg), made[-1] if made and not leg else None)
    if found is None and leg:
        raise UnknownName(because("unknown_target", leg=leg[:40]))
    return found


def choices_region(
    mission: Mission, entries: Sequence[TimelineEntry], recorded: ChoiceRecords, *, leg: str
) -> ChoicesRegion:
    """`recorded` belongs to what `shown_of` says."""
    choice = shown_of(mission, leg)
    inputs = _ChoiceHistory(
        mission=mission,
        entries=entries,
        stages={stage.node_id: stage for stage in stages(mission, entries, Observed(), selected="")},
        maps=dict(updates(mission)),
    )
    rows = tuple(
        _row(number, one, inputs, selected=one == choice)
        for number, one in enumerate(decisions(mission) if mission.contract else (), start=1)
    )
    chosen = next((row for row in rows if row.selected), None)
    return ChoicesRegion(
        mission_id=mission.mission_id,
        at=None,
        query=f"?leg={leg}" if leg else "",
        choices=rows,
        shown=_detail(inputs, choice, chosen, recorded) if choice and chosen else None,
    )


def exploration_page(
    shell: Shell, mission: Mission, entries: Sequence[TimelineEntry], region: ChoicesRegion
) -> ExplorationPage:
    return ExplorationPage(**vars(region), shell=shell, head=head(mission, entries))


def _row(number: int, choice: ExplorationDecision, inputs: _ChoiceHistory, *, selected: bool) -> ChoiceRow:
    change = inputs.maps.get(choice.leg)
    return ChoiceRow(
        number=number,
        leg=choice.leg,
        href=f"/missions/{choice.mission_id}/exploration?leg={choice.leg}",
        x_m=choice.target_m[0],
        y_m=choice.target_m[1],
        planner=choice.planner,
        overruled=bool(choice.refused),
        stage=inputs.stages[choice.leg],
        given_up=_given_up(inputs.mission.of(choice.leg)),
        opened_m2=change.opened_m2 if change else None,
        selected=selected,
    )


def _detail(
    inputs: _ChoiceHistory, choice: ExplorationDecision, row: ChoiceRow, recorded: ChoiceRecords
) -> ChoiceDetail:
    question, answer = recorded.question, recorded.answer
    proposal = answer.said if answer else None
    nodes = inputs.mission.contract.nodes if inputs.mission.contract else ()
    look = next((node.node_id for node in nodes if choice.leg in node.depends_on), "")
    return ChoiceDetail(
        row=row,
        reason=reasoned(choice.reason),
        said=lazy_gettext("({x}, {y}): {reason}", **_placed(proposal.target_m), reason=proposal.reason)
        if proposal
        else "",
        refused=reasoned(choice.refused),
        at_s=question.at_s if question else None,
        k=choice.k,
        position=_made_at(inputs.entries, choice.leg),
        edges=question.frontiers if question else (),
        target_m=choice.target_m,
        known=tuple(_known(one) for one in question.feedback) if question else (),
        left=question.left if question else 0,
        longest_way_m=question.longest_way_m if question else 0.0,
        route_m=sum(dist(a, b) for a, b in pairwise(answer.route_m)) if answer else 0.0,
        image=choice.image,
        map_before=choice.map_before,
        map_after=choice.map_after or "",
        question=choice.question,
        answer=choice.answer,
        recorded=question is not None and answer is not None,
        look=inputs.stages.get(look),
        change=inputs.maps.get(choice.leg),
        floor=explored_floor(recorded.before, recorded.after, question=question, answer=answer),
    )


def _given_up(leg: NodeState) -> str:
    """The class and the harness's own record of the last failure of a leg that is not tried again."""
    if leg.status != "failed" or not leg.failures:
        return ""
    last = leg.failures[-1]
    return lazy_gettext(
        "given up: {failure}. {reason}", failure=word(last.failure), reason=beside(last.failure, last.reason)
    )


def _known(word_of: exploration.AnyFeedback) -> str:
    """What the proposer was told about an earlier target, as a sentence."""
    place = _placed(word_of.target_m)
    match word_of:
        case exploration.Reached(moved_m=moved_m):
            return lazy_gettext("({x}, {y}) was reached, {moved} m on the way.", **place, moved=f"{moved_m:.1f}")
        case exploration.BlockedTarget(failure=failure, reason=reason):
            return lazy_gettext(
                "({x}, {y}) was given up: {failure}. {reason}",
                **place,
                failure=word(failure),
                reason=beside(failure, reason),
            )
        case exploration.MapChanged(opened_m2=opened, closed_m2=closed):
            return lazy_gettext(
                "On the way to ({x}, {y}) {opened} m² became known as free, {closed} m² as closed.",
                **place,
                opened=f"{opened:.1f}",
                closed=f"{closed:.1f}",
            )


def _placed(at_m: tuple[float, float]) -> Mapping[str, str]:
    return {"x": f"{at_m[0]:.1f}", "y": f"{at_m[1]:.1f}"}


def _made_at(entries: Sequence[TimelineEntry], leg: str) -> int | None:
    """The event whose contract has this leg first."""
    revised = ((one.position, one.event.contract) for one in entries if isinstance(one.event, GraphRevised))
    found = (position for position, made in revised if made and any(node.node_id == leg for node in made.nodes))
    return next(found, None)
