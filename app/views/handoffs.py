"""Pure: handoffs as a list, and one question to a person: what happens without an answer first, the action last."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from app.views.budgets import Budget, budget
from app.views.measures import ConditionRow, condition_row, quantity
from app.views.missions import RobotStrip
from app.views.shell import Shell
from harness.contracts.handoff_events import HandoffOpened, ProposedAction
from harness.contracts.ids import sha256
from harness.contracts.values import encode
from harness.projections.handoffs import Handoff
from harness.projections.mission import Mission

FRESH_S = 60.0
REASONS = ("seen on camera", "checked on site", "path is clear now", "not safe")
NO_ANSWER = {
    "hold": "the robot stays where it is",
    "lie_down": "the robot lies down where it is",
    "retreat": "the robot goes back the way that was authorised before",
}
ACTIONS = {
    "re_perceive": "Look again with its own sensors",
    "adjust_view": "Turn a little and look again",
    "retry": "Try the same stage again",
    "local_replan": "Plan a way round and go on",
    "switch_skill": "Let another provider do the stage",
}


@dataclass(frozen=True)
class HandoffRow:
    """One question in a list."""

    handoff_id: str
    mission_id: str
    title: str
    failure: str
    status: str
    opened_at_s: float
    deadline_at_s: float
    answered: str


@dataclass(frozen=True)
class HandoffsPage:
    """Open questions first, then how earlier ones ended."""

    shell: Shell
    waiting: tuple[HandoffRow, ...]
    ended: tuple[HandoffRow, ...]


@dataclass(frozen=True)
class Step:
    """One of the facts that follow a decision: each stands for itself, none is assumed."""

    name: str
    state: str
    text: str


@dataclass(frozen=True)
class ActionView:
    """What would run, read back from the very bytes whose digest is approved. `sound` is false if they differ."""

    title: str
    rows: tuple[tuple[str, str], ...]
    parameters: tuple[tuple[str, str], ...]
    limits: tuple[tuple[str, str], ...]
    digest: str
    body: str
    sound: bool


@dataclass(frozen=True)
class SnapshotView:
    """The robot as it stood when it was looked at; the picture is evidence by digest."""

    taken_at_s: float
    x_m: float
    y_m: float
    yaw_deg: float
    static: bool
    image: str


@dataclass(frozen=True)
class Similar:
    """How earlier questions of this kind at this stage ended."""

    total: int
    text: str


@dataclass(frozen=True)
class HandoffPage:
    """Everything a person needs to answer, and exactly what the answer is bound to."""

    shell: Shell
    handoff_id: str
    mission_id: str
    node_id: str
    title: str
    status: str
    open: bool
    cycle: int
    k: int
    subject: str
    evidence: str
    failure: str
    reason: str
    risk: str
    no_answer: str
    opened_at_s: float
    deadline_at_s: float
    now_s: float
    fresh_until_s: float
    snapshot: SnapshotView
    robot: RobotStrip | None
    conditions: tuple[ConditionRow, ...]
    verdict: str
    budget: Budget
    action: ActionView | None
    steps: tuple[Step, ...]
    similar: Similar
    reasons: tuple[str, ...]
    typed: str
    key: str
    refused: str


def title(handoff: Handoff, mission: Mission | None) -> str:
    """A sentence that the robot could say."""
    opened = handoff.opened
    if opened is None:
        return f"Handoff {handoff.handoff_id}"
    stage = opened.node_id.replace("_", " ")
    if mission is not None and mission.contract is not None and opened.node_id in mission.nodes:
        stage = mission.contract.node(opened.node_id).subgoal
    verb = "asked about" if handoff.status != "open" else "cannot finish"
    return f"{opened.robot_id} {verb} “{stage}”" + (" and asks you" if handoff.status == "open" else "")


def row(handoff: Handoff, mission: Mission | None) -> HandoffRow:
    opened = required(handoff)
    answer = handoff.answer
    return HandoffRow(
        handoff_id=handoff.handoff_id,
        mission_id=opened.mission_id,
        title=title(handoff, mission),
        failure=opened.failure,
        status=handoff.status,
        opened_at_s=opened.opened_at_s,
        deadline_at_s=opened.deadline_at_s,
        answered=f"{answer.actor.name}: {answer.reason}" if answer else handoff.outcome,
    )


def handoffs_page(shell: Shell, rows: Sequence[HandoffRow]) -> HandoffsPage:
    return HandoffsPage(
        shell=shell,
        waiting=tuple(one for one in rows if one.status == "open"),
        ended=tuple(one for one in rows if one.status != "open"),
    )


@dataclass(frozen=True)
class Surface:
    """What the page needs beside the handoff and its mission: the instant, the robot, the form as it was left."""

    now_s: float
    robot: RobotStrip | None
    earlier: Sequence[Handoff]
    key: str
    typed: str = ""
    refused: str = ""


def handoff_page(shell: Shell, handoff: Handoff, mission: Mission, surface: Surface) -> HandoffPage:
    opened = required(handoff)
    state = mission.nodes.get(opened.node_id)
    verdict = state.verdicts[-1] if state and state.verdicts else None
    return HandoffPage(
        shell=shell,
        handoff_id=handoff.handoff_id,
        mission_id=opened.mission_id,
        node_id=opened.node_id,
        title=title(handoff, mission),
        status=handoff.status,
        open=handoff.status == "open",
        cycle=handoff.cycle,
        k=opened.k,
        subject=opened.subject,
        evidence=opened.evidence,
        failure=opened.failure,
        reason=opened.reason,
        risk=opened.risk,
        no_answer=NO_ANSWER[opened.no_answer],
        opened_at_s=opened.opened_at_s,
        deadline_at_s=opened.deadline_at_s,
        now_s=surface.now_s,
        fresh_until_s=opened.snapshot.taken_at_s + FRESH_S,
        snapshot=_snapshot(opened),
        robot=surface.robot,
        conditions=tuple(condition_row(result) for result in verdict.results) if verdict else (),
        verdict=verdict.verdict if verdict else "",
        budget=budget(mission, opened.node_id),
        action=action_view(opened.proposal, subject=opened.subject),
        steps=_steps(handoff, mission),
        similar=similar(handoff, surface.earlier),
        reasons=REASONS,
        typed=surface.typed,
        key=surface.key,
        refused=surface.refused,
    )


def required(handoff: Handoff) -> HandoffOpened:
    """The opening of a handoff that exists; one without it is a programming error."""
    if handoff.opened is None:
        raise ValueError(f"handoff {handoff.handoff_id} was never opened")
    return handoff.opened


def action_view(proposal: ProposedAction | None, *, subject: str) -> ActionView | None:
    """Rows come from the canonical bytes, so that nothing can be shown that is not digested."""
    if proposal is None:
        return None
    body = encode(proposal)
    said: dict[str, Any] = json.loads(body)
    action, parameters, limits = said.pop("action"), said.pop("parameters"), said.pop("limits")
    return ActionView(
        title=ACTIONS.get(action, action.replace("_", " ")),
        rows=(("action", action), *((name.replace("_", " "), _shown(value)) for name, value in said.items())),
        parameters=tuple((quantity(name, "")[0], _valued(name, value)) for name, value in parameters.items()),
        limits=tuple(quantity(name, value) for name, value in limits.items()),
        digest=sha256(body),
        body=body.decode(),
        sound=sha256(body) == subject,
    )


def similar(handoff: Handoff, earlier: Sequence[Handoff]) -> Similar:
    """Questions about the same stage for the same reason, this one not counted."""
    opened = required(handoff)
    alike = [
        one
        for one in earlier
        if one.opened is not None
        and one.handoff_id != handoff.handoff_id
        and (one.opened.node_id, one.opened.failure) == (opened.node_id, opened.failure)
    ]
    ends: dict[str, int] = {}
    for one in alike:
        ends[one.status] = ends.get(one.status, 0) + 1
    return Similar(total=len(alike), text=", ".join(f"{many} {status}" for status, many in sorted(ends.items())))


def _snapshot(opened: HandoffOpened) -> SnapshotView:
    seen = opened.snapshot
    return SnapshotView(
        taken_at_s=seen.taken_at_s,
        x_m=seen.x_m,
        y_m=seen.y_m,
        yaw_deg=seen.yaw_rad * 57.29578,
        static=seen.static,
        image=seen.image or "",
    )


def _steps(handoff: Handoff, mission: Mission) -> tuple[Step, ...]:
    """Approved, dispatched, moving, verified: after a decision only."""
    answer = handoff.answer
    if handoff.status == "open":
        return ()
    if handoff.status in ("rejected", "expired", "superseded") or answer is None:
        who = f"{answer.actor.name}: {answer.reason}" if answer else handoff.outcome or "nobody answered in time"
        ended = "done" if mission.ended else "pending"
        return (
            Step(name=handoff.status, state="done", text=who),
            Step(name="mission", state=ended, text=f"{mission.status.replace('_', ' ')}. {mission.reason}".strip()),
        )
    sent = handoff.invocation_id is not None
    open_now = mission.invocation is not None and mission.invocation.intent.invocation_id == handoff.invocation_id
    moving = "current" if open_now else "done" if sent else "pending"
    known = handoff.status in ("confirmed", "failed", "unknown")
    return (
        Step(name="approved", state="done", text=f"{answer.actor.name}: {answer.reason}"),
        Step(name="dispatched", state="done" if sent else "pending", text=handoff.invocation_id or "not yet"),
        Step(name="moving", state=moving, text="under way" if open_now else "ended" if sent else "not yet"),
        Step(
            name="verified",
            state="done" if handoff.status == "confirmed" else "bad" if known else "pending",
            text=f"{handoff.status}: {handoff.outcome}" if known else "the harness has not confirmed an effect yet",
        ),
    )


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _valued(name: str, value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return quantity(name, value)[1]
    if isinstance(value, list) and len(value) > 6:
        return f"{len(value)} points, from {_shown(value[0])} to {_shown(value[-1])}"
    return _shown(value)
