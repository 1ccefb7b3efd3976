"""/api/v1/handoffs: questions to a person. Only a person's session answers them; a token may look again."""

import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import Field, StringConstraints
from starlette.responses import JSONResponse

from app.console import ActorDep, Console, ConsoleDep
from app.routes.api_words import (
    CHECKED,
    PROBLEMS,
    After,
    Body,
    DecisionBody,
    Facet,
    Limit,
    Reason,
    Slug,
    Words,
    answers,
    linked,
    place,
    plain,
    refusal,
)
from app.routes.handoff_page import changes, history_of
from app.views.handoff_shown import action_of
from harness.contracts.decisions import Refused
from harness.contracts.handoff_commands import (
    AttestCondition,
    ChooseAction,
    ClaimHandoff,
    CloseHandoff,
    DecideHandoff,
    HandBack,
    LookAgain,
    OnMyWay,
    PersonCommand,
    ReleaseHandoff,
    TakeOver,
)
from harness.contracts.ids import ConditionId, Digest, HandoffId
from harness.contracts.read_models import ListQuery
from harness.projections.handoffs import Handoff

router = APIRouter(
    prefix="/api/v1", default_response_class=JSONResponse, responses=PROBLEMS, dependencies=CHECKED, tags=["handoffs"]
)
Token = Annotated[str, StringConstraints(max_length=200)]
Cycle = Annotated[int, Field(ge=0, le=2**53)]
Waits = Annotated[str, Query(alias="open", max_length=200)]


class ClaimBody(Body):
    """Whose question it is: a token of the caller's making, the same again to renew."""

    claim: Slug


class WayBody(Body):
    """Why it should wait longer."""

    reason: Reason = "on my way"


class ChoiceBody(Body):
    """Another action of the ladder, on the question as it stood in this cycle."""

    action: Slug
    cycle: Cycle
    claim: Token = ""


class AttestBody(Body):
    """What a person saw of one condition with their own eyes."""

    condition_id: Slug
    statement: Reason
    key: Slug
    cycle: Cycle
    claim: Token = ""


class HeldBody(Body):
    """A word of whoever holds the claim."""

    reason: Reason
    key: Slug
    claim: Slug


class TakeOverBody(HeldBody):
    """From which device the robot is driven."""

    device: Slug


@router.get("/handoffs", responses=answers(Handoff, many=True))
def handoffs(
    console: ConsoleDep,
    response: Response,
    q: Words = "",
    status: Facet = "",
    waits: Waits = "",
    robot: Facet = "",
    after: After = "",
    limit: Limit = 100,
) -> Any:
    """Handoffs as they stand now, newest first; with `open=yes` those that wait, claimed or taken over or not."""
    given = {"status": status, "open": waits, "robot": robot}
    facets = {name: value for name, value in given.items() if value}
    query = ListQuery(listing="handoff", facets=facets, words=tuple(q.split()), after=place(after), limit=limit)
    found = console.lists.handoffs(query)
    linked(response, "/api/v1/handoffs", found, limit=str(limit), q=q, **facets)
    return [plain(console.runtime.handoff(HandoffId(one.handoff_id))) for one in found.items]


@router.get("/handoffs/{handoff_id}", responses=answers(Handoff))
def handoff(console: ConsoleDep, handoff_id: HandoffId) -> Any:
    """What a person is asked, on exactly which bytes, and what was answered."""
    return plain(console.runtime.handoff(handoff_id))


@router.post("/handoffs/{handoff_id}/look", responses=answers(Handoff))
def look_again(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> Any:
    """Observe without motion; the answer is the handoff as it is after that."""
    return _said(console, LookAgain(handoff_id=handoff_id, actor=actor))


@router.post("/handoffs/{handoff_id}/claim", responses=answers(Handoff))
def claim(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: ClaimBody) -> Any:
    """Yours to answer for a minute; the same token again renews it."""
    return _said(console, ClaimHandoff(handoff_id=handoff_id, actor=actor, claim=body.claim))


@router.post("/handoffs/{handoff_id}/release", responses=answers(Handoff))
def release(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: ClaimBody) -> Any:
    """Somebody else may answer it."""
    return _said(console, ReleaseHandoff(handoff_id=handoff_id, actor=actor, claim=body.claim))


@router.post("/handoffs/{handoff_id}/on-my-way", responses=answers(Handoff))
def on_my_way(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: WayBody) -> Any:
    """Wait longer: once, as long as the zone allows."""
    return _said(console, OnMyWay(handoff_id=handoff_id, actor=actor, reason=body.reason))


@router.post("/handoffs/{handoff_id}/choose", responses=answers(Handoff))
def choose(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: ChoiceBody) -> Any:
    """Ask anew with another action of the ladder; it is approved, if at all, on its own digest."""
    command = ChooseAction(
        handoff_id=handoff_id, actor=actor, action=action_of(body.action), cycle=body.cycle, claim=body.claim
    )
    return _said(console, command)


@router.post("/handoffs/{handoff_id}/decision", responses=answers(Handoff))
def decide(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: DecisionBody) -> Any:
    """The same key and body again is the same receipt; any other second answer is a 409."""
    command = DecideHandoff(
        handoff_id=handoff_id,
        decision=body.decision,
        actor=actor,
        reason=body.reason,
        key=body.key,
        cycle=body.cycle,
        subject=Digest(body.subject),
        evidence=Digest(body.evidence),
        claim=body.claim,
    )
    return _said(console, command, cycle=body.cycle)


@router.post("/handoffs/{handoff_id}/attest", responses=answers(Handoff))
def attest(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: AttestBody) -> Any:
    """Evidence by a person, only where the stage's policy names it; it opens one look and satisfies nothing."""
    command = AttestCondition(
        handoff_id=handoff_id,
        condition_id=ConditionId(body.condition_id),
        actor=actor,
        statement=body.statement,
        key=body.key,
        cycle=body.cycle,
        claim=body.claim,
    )
    return _said(console, command, cycle=body.cycle)


@router.post("/handoffs/{handoff_id}/take-over", responses=answers(Handoff))
def take_over(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: TakeOverBody) -> Any:
    """Drive it yourself: the deadline pauses as long as the claim is renewed."""
    command = TakeOver(
        handoff_id=handoff_id,
        actor=actor,
        claim=body.claim,
        device=body.device,
        key=body.key,
        reason=body.reason,
    )
    return _said(console, command)


@router.post("/handoffs/{handoff_id}/hand-back", responses=answers(Handoff))
def hand_back(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: HeldBody) -> Any:
    """The robot is the harness's again; it looks afresh, without motion."""
    command = HandBack(handoff_id=handoff_id, actor=actor, claim=body.claim, key=body.key, reason=body.reason)
    return _said(console, command)


@router.post("/handoffs/{handoff_id}/close", responses=answers(Handoff))
def close(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: HeldBody) -> Any:
    """Keep the robot: the mission ends handed off."""
    command = CloseHandoff(handoff_id=handoff_id, actor=actor, claim=body.claim, key=body.key, reason=body.reason)
    return _said(console, command)


def _said(console: Console, command: PersonCommand, *, cycle: int | None = None) -> Any:
    """The handoff after it, or a problem; one about an older cycle lists what changed since."""
    console.runtime.handoff(command.handoff_id)
    decision = console.runtime.answer(command)
    if not isinstance(decision, Refused):
        return handoff(console, command.handoff_id)
    told = refusal(decision)
    if cycle is None:
        return told
    now = console.runtime.handoff(command.handoff_id)
    found = changes(now, history_of(console, command.handoff_id), str(cycle))
    document = json.loads(bytes(told.body)) | {
        "changes": [{"name": one.name, "was": one.was, "now": one.now} for one in found]
    }
    return JSONResponse(document, status_code=told.status_code, media_type=told.media_type)
