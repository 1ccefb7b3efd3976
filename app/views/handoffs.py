"""Pure: one question to a person: what happens without an answer first, then what to decide."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned, word
from app.i18n.task_texts import bound_text, task_text
from app.views import handoff_steps
from app.views.handoff_shown import ACTIONS, ShownDifference, ShownQuestion, shown_question
from app.views.places import SiteMap
from app.views.robots import CameraView, LastReport
from app.views.shell import Shell
from harness.contracts.effects import Condition
from harness.contracts.handoff_events import HandoffOpened
from harness.contracts.read_models import HandoffItem
from harness.contracts.values import Point
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission
from harness.projections.missions_list import stage_sentence

FRESH_S = 60.0
REASONS = (N_("seen on camera"), N_("checked on site"), N_("path is clear now"), N_("not safe"))
NOTIFIED = {"sound": N_("chime"), "next_person": N_("next on call"), "outside": N_("external")}
"""Who or what was notified at each level of escalation."""
NO_ANSWER = {
    "hold": N_("the robot stays where it is"),
    "lie_down": N_("the robot lies down where it is"),
    "retreat": N_("the robot goes back the way that was authorised before"),
}


@dataclass(frozen=True)
class RobotMark:
    """Where the robot stands on the map, by its own localiser, in the map's drawing: y grows downwards."""

    name: str
    x: float
    y: float
    yaw_deg: float
    live: bool


@dataclass(frozen=True)
class AlternativeAction:
    """Another action that could be proposed instead."""

    action: str
    title: str
    chosen: bool


@dataclass(frozen=True)
class Holding:
    """Whose question it is. `mine`: this person's; `token` is theirs, or a fresh one to claim with."""

    name: str
    mine: bool
    until_at_s: float
    token: str
    device: str
    control_reason: str
    taken_over: bool
    can_extend: bool
    extended_by: str


@dataclass(frozen=True)
class HandoffPage:
    """Everything a person needs to answer, and exactly what the answer is bound to. `shown` is what they saw.

    `following` is the question that the same mission asks now, if it is another one.
    """

    shell: Shell
    handoff_id: str
    mission_id: str
    robot_id: str
    title: str
    status: str
    waits: bool
    answerable: bool
    no_answer: str
    deadline_at_s: float
    now_s: float
    fresh_until_s: float
    shown: str
    question: ShownQuestion
    robot: LastReport | None
    camera: CameraView | None
    map: SiteMap
    marks: tuple[RobotMark, ...]
    hold: Holding
    viewers: tuple[str, ...]
    escalated: tuple[str, ...]
    choices: tuple[AlternativeAction, ...]
    attestable: tuple[Condition, ...]
    steps: tuple[handoff_steps.DecisionStep, ...]
    following: str
    similar: tuple[HandoffItem, ...]
    lines: tuple[handoff_steps.HandoffEventLine, ...]
    reasons: tuple[str, ...]
    typed: str
    key: str
    refused: str
    changes: tuple[ShownDifference, ...]


@dataclass(frozen=True)
class HandoffInputs:
    """What the page needs beside the handoff and its mission: the instant, the robot, the person, the form as left."""

    now_s: float
    person: str
    key: str
    shown: str
    told: handoff_steps.HandoffEvents
    earlier: Sequence[HandoffItem]
    map: SiteMap
    robot: LastReport | None = None
    camera: CameraView | None = None
    live_at: tuple[float, float, float] | None = None
    viewers: tuple[str, ...] = ()
    typed: str = ""
    refused: str = ""
    changes: tuple[ShownDifference, ...] = ()


def title(handoff: Handoff, mission: Mission | None) -> str:
    """A sentence that the robot could say."""
    opened = handoff.opened
    if opened is None:
        return lazy_gettext("Handoff {handoff_id}", handoff_id=handoff.handoff_id)
    stage = task_text(stage_sentence(mission, opened.node_id), mission.contract) if mission is not None else ""
    return asking(opened.robot_id, stage or word(opened.node_id), waits=handoff.waits)


def asking(robot: str, stage: str, *, waits: bool) -> str:
    """The sentence of a question, wherever it is listed."""
    if waits:
        return lazy_gettext("{robot} cannot finish “{stage}” and asks you", robot=robot, stage=stage)
    return lazy_gettext("{robot} asked about “{stage}”", robot=robot, stage=stage)


def question(item: HandoffItem) -> str:
    """The sentence of a question in a list."""
    bindings = {name: {"name": value} for name, value in item.names.items()}
    stage = bound_text(item.stage, item.template, bindings)
    return asking(item.robot_id, stage or word(item.node_id), waits=waits(item))


def waits(item: HandoffItem) -> bool:
    """Whether nobody has decided yet."""
    return item.status in ("open", "claimed", "taken_over")


def handoff_page(shell: Shell, handoff: Handoff, mission: Mission, surface: HandoffInputs) -> HandoffPage:
    opened = required(handoff)
    return HandoffPage(
        shell=shell,
        handoff_id=handoff.handoff_id,
        mission_id=opened.mission_id,
        robot_id=opened.robot_id,
        title=title(handoff, mission),
        status=handoff.status,
        waits=handoff.waits,
        answerable=handoff.answerable,
        no_answer=no_answer(opened),
        deadline_at_s=opened.deadline_at_s,
        now_s=surface.now_s,
        fresh_until_s=opened.snapshot.taken_at_s + FRESH_S,
        shown=surface.shown,
        question=shown_question(opened, mission),
        robot=surface.robot,
        camera=surface.camera,
        map=surface.map,
        marks=_marks(opened, surface.live_at),
        hold=_holding(handoff, surface),
        viewers=tuple(name for name in surface.viewers if name != surface.person),
        escalated=tuple(NOTIFIED[level] for level in handoff.escalated),
        choices=_choices(opened),
        attestable=_attestable(opened, mission),
        steps=handoff_steps.steps(handoff, mission, surface.told),
        following=_following(handoff, mission),
        similar=handoff_steps.similar(surface.earlier, handoff),
        lines=handoff_steps.history(surface.told),
        reasons=REASONS,
        typed=surface.typed,
        key=surface.key,
        refused=surface.refused,
        changes=surface.changes,
    )


def no_answer(opened: HandoffOpened) -> str:
    """What the robot does if nobody answers, as a clause."""
    if not opened.safe_place:
        return NO_ANSWER[opened.no_answer]
    if opened.otherwise == "lie_down":
        return lazy_gettext(
            "the robot goes to {place} on the way that was authorised before, or lies down where it cannot,",
            place=opened.safe_place,
        )
    return lazy_gettext(
        "the robot goes to {place} on the way that was authorised before, or stays where it cannot,",
        place=opened.safe_place,
    )


def _following(handoff: Handoff, mission: Mission) -> str:
    if mission.status != "awaiting_human" or mission.handoff_id == handoff.handoff_id:
        return ""
    return mission.handoff_id or ""


def required(handoff: Handoff) -> HandoffOpened:
    """The opening of a handoff that exists; one without it is a programming error."""
    if handoff.opened is None:
        raise ValueError(f"handoff {handoff.handoff_id} was never opened")
    return handoff.opened


def _holding(handoff: Handoff, surface: HandoffInputs) -> Holding:
    claim = handoff.claim if handoff.claim and handoff.claim.until_at_s > surface.now_s else None
    mine = claim is not None and claim.actor.name == surface.person
    opened = required(handoff)
    limit_s = opened.limit_at_s or opened.deadline_at_s
    return Holding(
        name=claim.actor.name if claim else "",
        mine=mine,
        until_at_s=claim.until_at_s if claim else 0.0,
        token=claim.claim if claim and mine else surface.key,
        device=handoff.control.device if handoff.control else "",
        control_reason=reasoned(handoff.control.reason) if handoff.control else "",
        taken_over=handoff.status == "taken_over",
        can_extend=handoff.extended_by is None and limit_s > opened.deadline_at_s + 1.0,
        extended_by=handoff.extended_by.name if handoff.extended_by else "",
    )


def _marks(opened: HandoffOpened, live: tuple[float, float, float] | None) -> tuple[RobotMark, ...]:
    seen = opened.snapshot
    found = [_mark(N_("when it was looked at"), (seen.x_m, seen.y_m), seen.yaw_rad, live=False)]
    if live is not None:
        found.append(_mark(lazy_gettext("{robot} now", robot=opened.robot_id), (live[0], live[1]), live[2], live=True))
    return tuple(found)


def _mark(name: str, at: Point, yaw_rad: float, *, live: bool) -> RobotMark:
    return RobotMark(name=name, x=round(at[0], 2), y=round(-at[1], 2), yaw_deg=round(-yaw_rad * 57.29578, 1), live=live)


def _choices(opened: HandoffOpened) -> tuple[AlternativeAction, ...]:
    now = opened.proposal.action if opened.proposal else ""
    return tuple(AlternativeAction(action=one, title=ACTIONS[one], chosen=one == now) for one in opened.choices)


def _attestable(opened: HandoffOpened, mission: Mission) -> tuple[Condition, ...]:
    """Conditions that a person may attest to, where the stage's evidence policy names them."""
    contract = mission.contract
    if (
        contract is None
        or opened.node_id not in mission.nodes
        or not contract.node(opened.node_id).evidence.attestation
    ):
        return ()
    return contract.node(opened.node_id).success_conditions
