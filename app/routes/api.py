"""/api/v1: what the command line needs from the owner of a data folder. JSON in, JSON or a problem document out."""

from typing import Annotated, Any, Literal

import msgspec
from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import JSONResponse, Response

from app.console import ActorDep, Console, ConsoleDep
from app.errors import problem
from app.routes.missions import started
from app.views.outcome import mission_outcome
from harness.contracts.commands import DecideHandoff, LookAgain, StopMission
from harness.contracts.decisions import Refused
from harness.contracts.events import Autonomy
from harness.contracts.ids import Digest, HandoffId, MissionId, RobotId
from harness.runtime import Start

router = APIRouter(prefix="/api/v1", default_response_class=JSONResponse)
Slug = Annotated[str, Field(min_length=1, max_length=200)]
Reason = Annotated[str, Field(min_length=1, max_length=200)]


class StartBody(BaseModel):
    """A mission to start: a template by name, or a goal that one matches. No robot named: the console's first."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    robot_id: Annotated[str, Field(max_length=200)] = ""
    template: str = ""
    goal: Annotated[str, Field(max_length=2000)] = ""
    arguments: dict[str, str | float] = {}
    seed: Annotated[int, Field(ge=0)] = 0
    autonomy: Autonomy = "autonomous"
    labels: dict[str, str] = {}


class StopBody(BaseModel):
    """Why a mission is stopped."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    reason: Reason


class DecisionBody(BaseModel):
    """An answer bound to what was seen: the digests come from the handoff as it was shown."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    decision: Literal["approve", "reject"]
    reason: Reason
    key: Slug
    cycle: Annotated[int, Field(ge=0)]
    subject: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    evidence: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


@router.get("/missions")
def missions(console: ConsoleDep) -> list[dict[str, Any]]:
    """Every mission, newest first, in short."""
    return [
        {
            "mission_id": one.mission_id,
            "robot_id": one.robot_id,
            "goal": one.goal,
            "template": one.template,
            "status": one.status,
            "goal_verdict": one.goal_verdict.verdict if one.goal_verdict else None,
            "state_version": one.k,
            "handoff_id": one.handoff_id,
        }
        for one in console.runtime.missions()
    ]


@router.get("/missions/{mission_id}")
def mission(console: ConsoleDep, mission_id: MissionId) -> dict[str, Any]:
    """The object that `regen mission run --json` prints."""
    return outcome(console, mission_id)


@router.post("/missions", status_code=201)
def start(console: ConsoleDep, actor: ActorDep, body: StartBody) -> dict[str, Any]:
    order = Start(
        actor=actor,
        robot_id=RobotId(body.robot_id or console.settings.robots[0]),
        template=body.template,
        goal=body.goal,
        arguments=dict(body.arguments),
        seed=body.seed,
        autonomy=body.autonomy,
        labels=dict(body.labels),
    )
    return outcome(console, started(console, order))


@router.post("/missions/{mission_id}/stop")
def stop(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, body: StopBody) -> Any:
    decision = console.runtime.submit(mission_id, StopMission(actor=actor, reason=body.reason))
    return refusal(decision) if isinstance(decision, Refused) else outcome(console, mission_id)


@router.get("/missions/{mission_id}/events")
def events(console: ConsoleDep, mission_id: MissionId, after: Annotated[int, Query(ge=0)] = 0) -> list[dict[str, Any]]:
    """Events after a position, with their places in the hash chain."""
    return [
        {
            "position": entry.position,
            "version": entry.version,
            "kind": entry.kind,
            "mission_s": entry.mission_s,
            "recorded_s": entry.recorded_s,
            "previous": entry.previous,
            "digest": entry.digest,
            "event": msgspec.to_builtins(entry.event),
        }
        for entry in console.histories.of(mission_id)
        if entry.position > after
    ]


@router.get("/handoffs")
def handoffs(console: ConsoleDep, status: str = "") -> list[Any]:
    """Every handoff, newest first; with `status=open` only those that wait."""
    return [msgspec.to_builtins(one) for one in console.runtime.handoffs() if not status or one.status == status]


@router.get("/handoffs/{handoff_id}")
def handoff(console: ConsoleDep, handoff_id: HandoffId) -> Any:
    return msgspec.to_builtins(console.runtime.handoff(handoff_id))


@router.post("/handoffs/{handoff_id}/look")
def look_again(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> Any:
    """Observe without motion; the answer is the handoff as it is after that."""
    console.runtime.handoff(handoff_id)
    decision = console.runtime.answer(LookAgain(handoff_id=handoff_id, actor=actor))
    return refusal(decision) if isinstance(decision, Refused) else handoff(console, handoff_id)


@router.post("/handoffs/{handoff_id}/decision")
def decide(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: DecisionBody) -> Any:
    """The same key and body again is the same receipt; any other second answer is a 409."""
    console.runtime.handoff(handoff_id)
    command = DecideHandoff(
        handoff_id=handoff_id,
        decision=body.decision,
        actor=actor,
        reason=body.reason,
        key=body.key,
        cycle=body.cycle,
        subject=Digest(body.subject),
        evidence=Digest(body.evidence),
    )
    decision = console.runtime.answer(command)
    return refusal(decision) if isinstance(decision, Refused) else handoff(console, handoff_id)


@router.post("/sign-in-links", status_code=201)
def sign_in_link(console: ConsoleDep) -> dict[str, str]:
    """A fresh one-time link for a person."""
    return {"url": f"{console.settings.address}{console.doors.invite()}"}


def outcome(console: Console, mission_id: MissionId) -> dict[str, Any]:
    """One mission as JSON; raises UnknownName."""
    return mission_outcome(
        console.runtime.mission(mission_id), console.histories.of(mission_id), console.starts(mission_id)
    )


def refusal(decision: Refused) -> Response:
    return problem(
        409, code=decision.rule, title="Refused", detail=decision.message, do="look at it again, then decide"
    )
