"""Shapes the list of handoffs and the page of one: the question, what happens without an answer, and what followed."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from msgspec import UnsetType

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned, word
from app.i18n.task_texts import bound_text, task_text
from app.views.handoff_question import ACTIONS, ShownQuestion, shown_question, waits_aside
from app.views.history import HistoryLine, ShownDifference
from app.views.places import SiteMap
from app.views.robots import CameraView, LastReport
from app.views.seen_around import SeenAround
from app.views.shell import Shell
from app.views.svg_floor import polyline
from app.views.tabbed_list import Group, ListShape
from harness.contracts.alert_events import AlertNotified
from harness.contracts.effects import Condition
from harness.contracts.handoff_events import (
    LONGEST_WAIT_S,
    SLOWEST_MPS,
    HandoffEscalated,
    HandoffEvent,
    HandoffOpened,
    ProposedAction,
)
from harness.contracts.ids import PlaceId
from harness.contracts.read_models import HandoffItem
from harness.contracts.routine_approvals import is_routine
from harness.contracts.values import Point
from harness.projections.alerts import Alert
from harness.projections.handoffs import Handoff, HandoffAnswer
from harness.projections.mission import Mission
from harness.projections.missions_list import stage_sentence

GROUPS: tuple[Group, ...] = (
    ("", "all", {}),
    ("waiting", N_("waiting for a person"), {"open": "yes"}),
    ("ended", N_("answered or over"), {"open": "no"}),
    ("expired", N_("nobody answered"), {"status": "expired"}),
)
LIST = ListShape("/handoffs", GROUPS, filters=(("robot", "robot"), ("failure", "why")), by_length=False)
FRESH_S = 60.0
WAIT_S, WAIT_ASIDE_S = 30.0, 60.0
"""How long a start waits that is offered at one press."""
REASONS = (N_("seen on camera"), N_("checked on site"), N_("path is clear now"), N_("not safe"))
UNCLAIMED = {
    "sound": N_("announced in the open consoles"),
    "next_person": N_("nobody took it for a minute"),
    "outside": N_("nobody took it for three minutes"),
}
"""What had happened when a level of escalation was due. Who was notified is in the record of the alert."""
NO_ANSWER = {
    "hold": N_("the robot stays where it is"),
    "lie_down": N_("the robot lies down where it is"),
    "retreat": N_("the robot goes back the way that was authorised before"),
}
"""What the robot does if nobody answers, as a clause."""
NO_ANSWER_ACTIONS = {
    "hold": N_("stay where it is"),
    "lie_down": N_("lie down where it is"),
    "retreat": N_("return to the safe point"),
}
"""The same in a column or beside a mark: an action without its subject."""
HandoffEvents = Sequence[tuple[int, float, HandoffEvent]]
"""Position in the log, wall time and event of one handoff's stream, in order."""
ENDED = ("rejected", "expired", "superseded", "closed")
KNOWN = ("confirmed", "failed", "unknown")
TAKING_UP = ("HandoffApproved", "HandoffRejected", "HandoffAttested", "HandoffHandedBack", "HandoffClosed")
OVER = (*TAKING_UP, "HandoffExpired", "HandoffSuperseded")


@dataclass(frozen=True)
class DecisionStep:
    """One of the facts that follow a decision."""

    name: str
    state: str
    text: str


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
    """Something else that could be proposed: an action, later or slower where that is what differs."""

    action: str
    title: str
    wait_s: float = 0.0
    speed_cap_mps: float | None = None
    waiting_place: str = ""


@dataclass(frozen=True)
class ProposalOptions:
    """What can be proposed instead: at one press, or put together. `highest_mps` is None for what drives nowhere."""

    offers: tuple[AlternativeAction, ...]
    actions: tuple[AlternativeAction, ...]
    chosen: str
    wait_s: float
    longest_wait_s: float
    speed_mps: float | None
    lowest_mps: float
    highest_mps: float | None


@dataclass(frozen=True)
class ClaimView:
    """Who has claimed the question. `mine`: this person; `token` is their claim, or a fresh one to claim with."""

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
class HandoffScene:
    """Where the question was asked: the map with what the lidar sees, and the robot and its camera where this console
    is connected to them."""

    map: SiteMap
    seen: SeenAround
    robot: LastReport | None
    camera: CameraView | None
    simulated: bool = False


@dataclass(frozen=True)
class HandoffForm:
    """The forms of the page as they were left. `shown` is the digest of what the person sees; `key` is one-use.

    `word` names the form that was sent last, `fields` what was typed in it.
    """

    shown: str
    key: str
    word: str
    fields: Mapping[str, str]
    refused: str
    changes: tuple[ShownDifference, ...]

    def left(self, word: str, name: str) -> str:
        """What was typed in this field of this form."""
        return self.fields.get(name, "") if word == self.word else ""


@dataclass(frozen=True)
class HandoffInputs:
    """What the page is made from beside the handoff and its mission.

    `live_at` is x and y in metres and yaw in radians, by the robot's localiser; None where it is not connected.
    `notified` are the notifications that external services accepted meanwhile; `places` are the names of the site's
    places.
    """

    now_s: float
    person: str
    viewers: tuple[str, ...]
    told: HandoffEvents
    earlier: Sequence[HandoffItem]
    live_at: tuple[float, float, float] | None
    scene: HandoffScene
    form: HandoffForm
    notified: tuple[AlertNotified, ...] = ()
    places: Mapping[PlaceId, str] = field(default_factory=dict)


@dataclass(frozen=True)
class HandoffPage:
    """Everything a person needs to answer, and exactly what the answer is bound to.

    `following` is the question that the same mission asks now, if it is another one; `viewers` are the other people who
    have the page open.
    """

    shell: Shell
    handoff: Handoff
    scene: HandoffScene
    form: HandoffForm
    question: ShownQuestion
    title: str
    no_answer: str
    fresh_until_s: float
    marks: tuple[RobotMark, ...]
    route: str
    hold: ClaimView
    viewers: tuple[str, ...]
    notified: tuple[str, ...]
    options: ProposalOptions
    attestable: tuple[Condition, ...]
    steps: tuple[DecisionStep, ...]
    paused: bool
    following: str
    similar: tuple[HandoffItem, ...]
    lines: tuple[HistoryLine, ...]
    reasons: tuple[str, ...]
    routine: bool


def title(handoff: Handoff, mission: Mission | None) -> str:
    """The title of the question: which robot asks about which stage."""
    opened = handoff.opened
    if opened is None:
        return lazy_gettext("Handoff {handoff_id}", handoff_id=handoff.handoff_id)
    stage = task_text(stage_sentence(mission, opened.node_id), mission.contract) if mission is not None else ""
    routine = is_routine(opened.failure, opened.reason)
    return asking(opened.robot_id, stage or word(opened.node_id), waits=handoff.waits, routine=routine)


def asking(robot: str, stage: str, *, waits: bool, routine: bool = False) -> str:
    """The title of a question about a stage; `routine`: nothing failed, a rule asks for a yes before the start."""
    if routine and waits:
        return lazy_gettext("{robot} waits for your yes before “{stage}”", robot=robot, stage=stage)
    if waits:
        return lazy_gettext("{robot} cannot finish “{stage}” and asks you", robot=robot, stage=stage)
    return lazy_gettext("{robot} asked about “{stage}”", robot=robot, stage=stage)


def question(item: HandoffItem) -> str:
    """The title of a question in a list."""
    bindings = {name: {"name": value} for name, value in item.names.items()}
    stage = bound_text(item.stage, item.templates, bindings)
    routine = is_routine(item.failure, item.reason)
    return asking(item.robot_id, stage or word(item.node_id), waits=waits(item), routine=routine)


def waits(item: HandoffItem) -> bool:
    """Whether nobody has decided yet."""
    return item.status in ("open", "claimed", "taken_over")


def handoff_page(shell: Shell, handoff: Handoff, mission: Mission, inputs: HandoffInputs) -> HandoffPage:
    """The page of one handoff for this person, at this instant."""
    opened = required(handoff)
    return HandoffPage(
        shell=shell,
        handoff=handoff,
        scene=inputs.scene,
        form=inputs.form,
        question=shown_question(opened, mission, inputs.places),
        title=title(handoff, mission),
        no_answer=no_answer(opened),
        fresh_until_s=opened.snapshot.taken_at_s + FRESH_S,
        marks=_marks(opened, inputs.live_at),
        route=_route(opened.proposal),
        hold=_holding(handoff, inputs),
        viewers=tuple(name for name in inputs.viewers if name != inputs.person),
        notified=tuple(dict.fromkeys(one.service for one in inputs.notified)),
        options=_options(opened, mission, inputs.places),
        attestable=_attestable(opened, mission),
        steps=steps(handoff, mission, inputs.told),
        paused=mission.status == "paused",
        following=_following(handoff, mission),
        similar=similar(inputs.earlier, handoff),
        lines=history(inputs.told),
        reasons=REASONS,
        routine=is_routine(opened.failure, opened.reason),
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


def _holding(handoff: Handoff, inputs: HandoffInputs) -> ClaimView:
    claim = handoff.claim if handoff.claim and handoff.claim.until_at_s > inputs.now_s else None
    mine = claim is not None and claim.actor.name == inputs.person
    opened = required(handoff)
    limit_s = opened.limit_at_s or opened.deadline_at_s
    return ClaimView(
        name=claim.actor.name if claim else "",
        mine=mine,
        until_at_s=claim.until_at_s if claim else 0.0,
        token=claim.claim if claim and mine else inputs.form.key,
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


def _route(proposal: ProposedAction | None) -> str:
    """The way that the proposed action would drive, as SVG points; empty where it drives none."""
    route = proposal.parameters.get("route") if proposal else None
    points = route if isinstance(route, tuple | list) else ()
    return polyline([(float(one[0]), float(one[1])) for one in points if isinstance(one, tuple | list)])


def _mark(name: str, at: Point, yaw_rad: float, *, live: bool) -> RobotMark:
    return RobotMark(name=name, x=round(at[0], 2), y=round(-at[1], 2), yaw_deg=round(-yaw_rad * 57.29578, 1), live=live)


def _options(opened: HandoffOpened, mission: Mission, names: Mapping[PlaceId, str]) -> ProposalOptions:
    proposal = opened.proposal
    now = proposal.action if proposal else ""
    limit_mps = proposal.limits["speed_cap_mps"] if proposal else None
    moves = proposal is not None and "speed_cap_mps" in proposal.parameters
    cap_mps = mission.contract.constraints.speed_cap_mps if mission.contract else limit_mps
    waits = 0.0 if proposal is None or isinstance(proposal.wait_s, UnsetType) else proposal.wait_s
    chosen_mps = limit_mps if moves and limit_mps != cap_mps else None
    actions = tuple(AlternativeAction(action=one, title=ACTIONS[one]) for one in opened.choices)
    return ProposalOptions(
        offers=(
            *(one for one in actions if one.action != now),
            *_slower(now, limit_mps if moves else None, wait_s=waits),
            *(() if waits or now not in opened.choices else (_later(now, speed_mps=chosen_mps),)),
            *(_aside(one, names) for one in opened.waiting_places if proposal is None or proposal.waiting_place != one),
        ),
        actions=actions,
        chosen=now,
        wait_s=waits,
        longest_wait_s=LONGEST_WAIT_S,
        speed_mps=chosen_mps,
        lowest_mps=SLOWEST_MPS,
        highest_mps=cap_mps if moves else None,
    )


def _slower(action: str, limit_mps: float | None, *, wait_s: float) -> tuple[AlternativeAction, ...]:
    """The current action at half its speed, where it drives and that is not too slow; its wait stays."""
    if limit_mps is None or limit_mps / 2 < SLOWEST_MPS:
        return ()
    speed_mps = round(limit_mps / 2, 2)
    title = lazy_gettext("Slower: at most {speed:g} m/s", speed=speed_mps)
    return (AlternativeAction(action=action, title=title, wait_s=wait_s, speed_cap_mps=speed_mps),)


def _aside(place_id: PlaceId, names: Mapping[PlaceId, str]) -> AlternativeAction:
    """Waiting out of the way before the stage goes on: another plan."""
    title = waits_aside(names.get(place_id, word(place_id)), WAIT_ASIDE_S)
    return AlternativeAction(action="local_replan", title=title, wait_s=WAIT_ASIDE_S, waiting_place=place_id)


def _later(action: str, *, speed_mps: float | None) -> AlternativeAction:
    """The current action after a wait; its speed stays."""
    title = lazy_gettext("Wait {seconds:g} s, then do it", seconds=WAIT_S)
    return AlternativeAction(action=action, title=title, wait_s=WAIT_S, speed_cap_mps=speed_mps)


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


def steps(handoff: Handoff, mission: Mission, events: HandoffEvents) -> tuple[DecisionStep, ...]:
    """What followed the decision: dispatched, moved, verified. A dispatched action is not yet a done one."""
    if handoff.waits or handoff.opened is None:
        return ()
    taken = next((position for position, _, event in events if type(event).__name__ in TAKING_UP), None)
    answer = handoff.answer
    if answer is None or handoff.status in ENDED:
        return _ended(handoff, mission, taken)
    first = DecisionStep(name=word(answer.decision), state="done", text=_taken_up(answer, taken))
    if handoff.status == "voided":
        return (
            first,
            DecisionStep(
                name="void", state="bad", text=lazy_gettext("{outcome}. Nothing was sent", outcome=handoff.outcome)
            ),
        )
    return (first, *_followed(handoff, mission))


def _followed(handoff: Handoff, mission: Mission) -> tuple[DecisionStep, ...]:
    sent = handoff.invocation_id is not None
    invocation = mission.invocation
    open_now = invocation is not None and invocation.intent.invocation_id == handoff.invocation_id
    moves = "moving" if (invocation.intent.moves if open_now and invocation else _moved(handoff)) else "looking"
    known = handoff.status in KNOWN
    proposal = handoff.opened.proposal if handoff.opened else None
    waits = handoff.status == "approved" and proposal is not None and not isinstance(proposal.wait_s, UnsetType)
    good = handoff.status == "confirmed"
    return (
        DecisionStep(
            name="dispatched",
            state="done" if sent else "pending",
            text=handoff.invocation_id or (N_("waits as approved, then starts") if waits else N_("not yet")),
        ),
        DecisionStep(
            name=moves,
            state="current" if open_now else "done" if sent else "pending",
            text=N_("under way") if open_now else "ended" if sent else N_("not yet"),
        ),
        DecisionStep(
            name="verified",
            state="done" if good else "bad" if known else "pending",
            text=_found(handoff) if known else N_("the harness has not confirmed an effect yet"),
        ),
    )


def _moved(handoff: Handoff) -> bool:
    """Whether what the answer set off moves the body: a hand-back, an attestation and a look do not."""
    proposal = handoff.opened.proposal if handoff.opened else None
    approved = handoff.answer is not None and handoff.answer.decision == "approved"
    return approved and proposal is not None and proposal.action not in ("verify_again", "re_perceive")


def _ended(handoff: Handoff, mission: Mission, taken: int | None) -> tuple[DecisionStep, ...]:
    answer, acted = handoff.answer, handoff.unanswered
    who = _taken_up(answer, taken) if answer else reasoned(handoff.outcome)
    found = [DecisionStep(name=handoff.status, state="done", text=who or N_("nobody answered in time"))]
    if acted is not None:
        found.append(
            DecisionStep(
                name=NO_ANSWER_ACTIONS[acted.action], state="done" if acted.done else "bad", text=reasoned(acted.reason)
            )
        )
    found.append(
        DecisionStep(
            name="mission",
            state="done" if mission.ended else "pending",
            text=lazy_gettext("{status}. {reason}", status=word(mission.status), reason=mission.reason),
        )
    )
    return tuple(found)


def _found(handoff: Handoff) -> str:
    return lazy_gettext("{status}: {outcome}", status=word(handoff.status), outcome=handoff.outcome)


def _taken_up(answer: HandoffAnswer, taken: int | None) -> str:
    return lazy_gettext(
        "{who}: {reason}. Decision applied at event {taken}", who=answer.actor.name, reason=answer.reason, taken=taken
    )


def similar(items: Sequence[HandoffItem], handoff: Handoff) -> tuple[HandoffItem, ...]:
    """Ended questions about the same stage for the same reason, newest first; this one not counted."""
    opened = handoff.opened
    return tuple(
        one
        for one in items
        if opened is not None and one.handoff_id != handoff.handoff_id and one.node_id == opened.node_id
    )


def history(events: HandoffEvents) -> tuple[HistoryLine, ...]:
    """The question's own events, newest last."""
    return tuple(HistoryLine(position=position, at_s=at_s, text=_sentence(event)) for position, at_s, event in events)


def notified_of(alerts: Iterable[Alert], opened: HandoffOpened, events: HandoffEvents) -> tuple[AlertNotified, ...]:
    """The notifications of this mission that a service accepted while the question stood."""
    over = next((at_s for _, at_s, event in events if type(event).__name__ in OVER), math.inf)
    return tuple(
        note
        for one in alerts
        if one.newest is not None and one.newest.mission_id == opened.mission_id
        for note in one.notified
        if note.outcome == "sent" and opened.opened_at_s <= note.at_s <= over
    )


def _escalation(event: HandoffEscalated) -> str:
    if event.actor is not None:
        return lazy_gettext("{who} asked a colleague", who=event.actor.name)
    return UNCLAIMED[event.level]


def _sentence(event: HandoffEvent) -> str:
    if isinstance(event, HandoffEscalated):
        return _escalation(event)
    words = "".join(f" {one.lower()}" if one.isupper() else one for one in type(event).__name__).strip()
    words = words.removeprefix("handoff ")
    actor, reason = getattr(event, "actor", None), getattr(event, "reason", "")
    device = getattr(event, "device", "")
    text = lazy_gettext("{what} by {who}", what=word(words), who=actor.name) if actor else word(words)
    text = lazy_gettext("{what} from {device}", what=text, device=device) if device else text
    return lazy_gettext("{what}: {reason}", what=text, reason=reason) if reason else text
