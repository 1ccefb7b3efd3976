"""/api/v1/handoffs: questions to a person. Only a person's session answers them; a token may look again."""

import json
from typing import Annotated, Any

from fastapi import Depends, Query, Response
from starlette.responses import JSONResponse

from app.acts import handoffs as acts
from app.acts.base import Act
from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests
from app.routes.handoff_page import answered, changes, history_of
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.ids import HandoffId
from harness.projections.handoffs import Handoff

router = api_requests.router("handoffs")
Waits = Annotated[str, Query(alias="open", max_length=200)]


@router.get("/handoffs", responses=api_requests.answers(Handoff, many=True))
def handoffs(
    console: ConsoleDep,
    response: Response,
    request: Annotated[api_requests.ListRequest, Depends(api_requests.list_request(100))],
    status: api_requests.Facet = "",
    waits: Waits = "",
    robot: api_requests.Facet = "",
) -> Any:
    """Handoffs as they stand now, newest first; with `open=yes` those that wait, claimed or taken over or not."""
    facets = {"status": status, "open": waits, "robot": robot}
    found = api_requests.listed(response, console.lists.handoffs, "handoff", "/handoffs", facets, request)
    return [api_requests.plain(console.runtime.handoff(HandoffId(one.handoff_id))) for one in found]


@router.get("/handoffs/{handoff_id}", responses=api_requests.answers(Handoff))
def handoff(console: ConsoleDep, handoff_id: HandoffId) -> Any:
    """What a person is asked, on exactly which bytes, and what was answered."""
    return api_requests.plain(console.runtime.handoff(handoff_id))


@router.post("/handoffs/{handoff_id}/look", responses=api_requests.answers(Handoff))
def look_again(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId) -> Any:
    """Observe again without motion; returns the handoff after that."""
    return _submitted(console, actor, handoff_id, acts.LookAgainAct())


@router.post("/handoffs/{handoff_id}/decision", responses=api_requests.answers(Handoff))
def decide(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: acts.Decision) -> Any:
    """Decide the handoff. The same key and body again returns the same receipt; any other second answer is a 409."""
    return _submitted(console, actor, handoff_id, body)


def _submitted(console: Console, actor: Actor, handoff_id: HandoffId, act: Act) -> Any:
    """The handoff after the act, or a problem that lists what changed since the person saw it."""
    console.runtime.handoff(handoff_id)
    decision = answered(console, actor, handoff_id, act)
    if not isinstance(decision, Refused):
        return handoff(console, handoff_id)
    refusal = api_requests.refusal(decision)
    if not isinstance(act, acts.ApproveHandoffAct | acts.RejectHandoffAct | acts.AttestHandoffAct):
        return refusal
    now = console.runtime.handoff(handoff_id)
    found = changes(now, history_of(console, handoff_id), str(act.cycle))
    document = json.loads(bytes(refusal.body)) | {
        "changes": [{"name": one.name, "was": one.was, "now": one.now} for one in found]
    }
    return JSONResponse(document, status_code=refusal.status_code, media_type=refusal.media_type)


def _act() -> api_requests.Handler:
    def act(console: ConsoleDep, actor: ActorDep, handoff_id: HandoffId, body: Any) -> Any:
        return _submitted(console, actor, handoff_id, body)

    return act


api_requests.post_acts(
    router,
    "/handoffs/{handoff_id}",
    {verb: kind for verb, kind in acts.ACTS.items() if verb != "look"},
    _act,
    answered=Handoff,
)
