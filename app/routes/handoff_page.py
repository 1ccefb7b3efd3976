"""Collects what the page of one handoff shows, and checks an answer against the page it was given on."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.acts.base import Act
from app.acts.handoffs import ApproveHandoffAct
from app.console import Console
from app.routes.robots import camera_of
from app.views import handoffs, robots
from app.views.fleet import OLD_POSE_S
from app.views.handoff_question import ShownQuestion, differences, shown_question, shown_record
from app.views.handoffs import HandoffEvents, HandoffForm, HandoffInputs, HandoffPage, HandoffScene
from app.views.history import ShownDifference
from app.views.places import site_map
from app.views.robot_map import swept
from app.views.robots import CameraView, LastReport
from app.views.seen_around import SeenAround
from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.decider import Codec
from harness.contracts.decisions import Decision, Refused, refused
from harness.contracts.errors import UnknownName
from harness.contracts.handoff_events import HandoffEvent, HandoffOpened
from harness.contracts.observations import Pose
from harness.contracts.read_models import HandoffItem, ListQuery
from harness.contracts.values import digest, encode
from harness.projections.handoffs import Handoff, apply
from harness.projections.mission import TERMINAL_MISSION

CODEC: Codec[HandoffEvent] = Codec(HandoffEvent)
EARLIER = 50


@dataclass(frozen=True)
class SubmittedForm:
    """A form as it was left: which it was, what was typed in it, and why it was refused."""

    word: str = ""
    fields: Mapping[str, str] = field(default_factory=dict)
    refused: str = ""


def page_of(
    console: Console, actor: Actor, handoff_id: ids.HandoffId, left: SubmittedForm = SubmittedForm()
) -> HandoffPage:
    """The page as it is now, with a fresh key; raises UnknownName."""
    handoff = console.runtime.handoff(handoff_id)
    opened = handoffs.required(handoff)
    mission = console.runtime.mission(opened.mission_id)
    events = history_of(console, handoff_id)
    topic = f"handoff/{handoff_id}"
    scene = HandoffScene(
        map=site_map(console.runtime.site),
        seen=_seen(console, mission.mission_id),
        robot=word_of(console, opened.robot_id),
        camera=_camera(console, opened.robot_id),
        simulated=console.clear_way is not None,
    )
    form = HandoffForm(
        shown=digest(shown_record(opened, mission)),
        key=console.sessions.key(),
        word=left.word,
        fields=left.fields,
        refused=left.refused,
        changes=changes(handoff, events, left.fields.get("cycle", "")) if left.refused else (),
    )
    inputs = HandoffInputs(
        now_s=console.clock(),
        person=actor.name,
        viewers=console.presence.watching(topic),
        told=events,
        earlier=_earlier(console, opened),
        live_at=_live_at(console, mission.mission_id),
        notified=handoffs.notified_of((one for _, one in console.alerts.all()), opened, events),
        scene=scene,
        form=form,
        places={one.place_id: one.name for one in console.runtime.site.places},
    )
    topics = (topic, f"mission/{mission.mission_id}", f"live/{mission.mission_id}")
    shell = console.shell(handoffs.title(handoff, mission), "handoffs", actor, topics=topics)
    return handoffs.handoff_page(shell, handoff, mission, inputs)


def question_of(console: Console, handoff_id: ids.HandoffId) -> ShownQuestion:
    """Subject and evidence as every person sees them now; raises UnknownName."""
    opened = handoffs.required(console.runtime.handoff(handoff_id))
    return shown_question(opened, console.runtime.mission(opened.mission_id))


def answered(console: Console, actor: Actor, handoff_id: ids.HandoffId, act: Act) -> Decision[AnyEvent]:
    """Submit a person's act. An approval that names the page it saw counts only if the page is still the same."""
    if isinstance(act, ApproveHandoffAct) and act.shown is not None:
        unseen = _unlike(console, handoff_id, act)
        if unseen is not None:
            return unseen
    return console.runtime.answer(handoff_id, act.to_command(actor))


def _unlike(console: Console, handoff_id: ids.HandoffId, act: ApproveHandoffAct) -> Refused | None:
    """The refusal if this person saw something else than the present page; None if it is the same or the gate decides.

    What was seen is kept, so that an auditor sees it again.
    """
    handoff = console.runtime.handoff(handoff_id)
    opened = handoffs.required(handoff)
    mission = console.runtime.mission(opened.mission_id)
    if not handoff.answerable or (act.cycle, mission.k) != (handoff.cycle, opened.k):
        return None
    body = encode(shown_record(opened, mission))
    if ids.sha256(body) != act.shown:
        return refused("unseen")
    console.runtime.keep(body)
    return None


def history_of(console: Console, handoff_id: ids.HandoffId) -> HandoffEvents:
    """The question's own events with their places in the log."""
    stored = console.runtime.stream(ids.handoff_stream(handoff_id))
    return [(one.position, one.recorded_s, CODEC.decode(one)) for one in stored]


def changes(handoff: Handoff, events: HandoffEvents, cycle: str) -> tuple[ShownDifference, ...]:
    """What is different now from the cycle that was answered."""
    opened = handoff.opened
    seen = seen_question(events, cycle)
    return differences(seen, opened) if seen is not None and opened is not None else ()


def seen_question(events: HandoffEvents, cycle: str) -> HandoffOpened | None:
    """The question as it stood in that cycle."""
    state, found = Handoff(), None
    for _, _, event in events:
        state = apply(state, event)
        if state.opened is not None and str(state.cycle) == cycle:
            found = state.opened
    return found


def _earlier(console: Console, opened: HandoffOpened) -> tuple[HandoffItem, ...]:
    facets = {"open": "no", "failure": opened.failure}
    return console.lists.handoffs(ListQuery(listing="handoff", facets=facets, limit=EARLIER)).items


def word_of(console: Console, robot_id: str) -> LastReport | None:
    """The robot's last report; None for one that is not connected here."""
    try:
        return robots.robot_word(console.fleet.word(robot_id), now_s=console.clock())
    except UnknownName:
        return None


def _camera(console: Console, robot_id: ids.RobotId) -> CameraView | None:
    try:
        return camera_of(console, robot_id)
    except UnknownName:
        return None


def _live_at(console: Console, mission_id: ids.MissionId) -> tuple[float, float, float] | None:
    """Where the robot is now; None where nobody knows. Of a mission that ended, its samples say nothing of now."""
    mission = console.runtime.mission(mission_id)
    live = console.runtime.observations(mission_id) if mission.status not in TERMINAL_MISSION else None
    pose = next((one for one in reversed(live.samples) if isinstance(one, Pose)), None) if live else None
    if pose is None:
        pose, age_s = _position(console, mission.robot_id)
        pose = pose if age_s <= OLD_POSE_S else None
    return (pose.x_m, pose.y_m, pose.yaw_rad) if pose else None


def _position(console: Console, robot_id: ids.RobotId) -> tuple[Pose | None, float]:
    try:
        return console.fleet.pose(robot_id)
    except UnknownName:
        return None, 0.0


def _seen(console: Console, mission_id: ids.MissionId) -> SeenAround:
    """What the newest lidar sweep shows around the robot, on the map; nothing where none is kept."""
    live = console.runtime.observations(mission_id)
    return swept(live.samples if live else (), console.runtime.blob)
