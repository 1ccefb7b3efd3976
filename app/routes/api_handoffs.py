"""/api/v1/handoffs: questions to a person. Only a person's session answers them; a token may look again."""

from typing import Any

from fastapi import APIRouter, Response
from starlette.responses import JSONResponse

from app.console import ActorDep, ConsoleDep
from app.routes.api_words import (
    CHECKED,
    PROBLEMS,
    After,
    DecisionBody,
    Facet,
    Limit,
    answers,
    linked,
    place,
    plain,
    refusal,
)
from harness.contracts.commands import DecideHandoff, LookAgain
from harness.contracts.decisions import Refused
from harness.contracts.ids import Digest, HandoffId
from harness.contracts.read_models import ListQuery

router = APIRouter(
    prefix="/api/v1", default_response_class=JSONResponse, responses=PROBLEMS, dependencies=CHECKED, tags=["handoffs"]
)


@router.get("/handoffs", responses=answers("Handoff", many=True))
def handoffs(
    console: ConsoleDep,
    response: Response,
    status: Facet = "",
    robot: Facet = "",
    after: After = "",
    limit: Limit = 100,
) -> Any:
    """Handoffs as they stand now, newest first; with `status=open` only those that wait."""
    facets = {name: value for name, value in (("status", status), ("robot", robot)) if value}
    found = console.lists.handoffs(ListQuery(listing="handoff", facets=facets, after=place(after), limit=limit))
    linked(response, "/api/v1/handoffs", found, limit=str(limit), **facets)
    return [plain(console.runtime.handoff(HandoffId(one.handoff_id))) for one in found.items]


@router.get("/handoffs/{handoff_id}", responses=answers("Handoff"))
def handoff(console: ConsoleDep, handoff_id: HandoffId) -> Any:
    """What a person is asked, on exactly which bytes, and what was answered."""
    return plain(console.runtime.handoff(handoff_id))


@router.post("/handoffs/{handoff_id}/look", responses=answers("Handoff"))
def look_again(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> Any:
    """Observe without motion; the answer is the handoff as it is after that."""
    console.runtime.handoff(handoff_id)
    decision = console.runtime.answer(LookAgain(handoff_id=handoff_id, actor=actor))
    return refusal(decision) if isinstance(decision, Refused) else handoff(console, handoff_id)


@router.post("/handoffs/{handoff_id}/decision", responses=answers("Handoff"))
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
