"""/api/v1: evidence, places, templates, providers and the audit of the log, read only."""

from typing import Annotated, Any

from fastapi import Path, Query, Response

from app.console import ConsoleDep
from app.routes import api_mission_schemas as mission_schemas
from app.routes import api_requests
from app.routes import api_schemas as schemas
from app.routes.audit import Before, Filter, newest_first
from app.routes.evidence import show as verified_blob
from app.views.audit import AuditEvent, AuditFilter
from app.web.security import PrincipalDep
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import MissionId, RobotId
from harness.contracts.memory import KnownCard
from harness.contracts.places import Site
from harness.contracts.ports import LogHead
from harness.contracts.read_models import EvidenceItem
from harness.contracts.tasks import TaskTemplate
from harness.extra_templates import offered
from harness.projections import exploration as explorations

router = api_requests.router("reading")
BLOB: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The bytes, verified against their digest as they were read.",
        "content": {
            kind: {"schema": {"type": "string", "contentMediaType": kind}}
            for kind in ("image/jpeg", "image/png", "audio/wav", "application/json", "application/octet-stream")
        },
    }
}


@router.get(
    "/missions/{mission_id}/exploration", responses=api_requests.answers(mission_schemas.ExplorationChoice, many=True)
)
def exploration(console: ConsoleDep, mission_id: MissionId) -> Any:
    """Every target that an exploring mission chose, oldest first, with what the proposer was asked and answered."""
    mission = console.runtime.mission(mission_id)
    made = explorations.decisions(mission) if mission.contract else ()
    return [
        api_requests.plain(
            mission_schemas.ExplorationChoice(
                decision=one,
                question=console.target_question(one.question),
                answer=console.target_answer(one.answer),
            )
        )
        for one in made
    ]


@router.get("/evidence", responses=api_requests.answers(EvidenceItem, many=True))
def evidence(
    console: ConsoleDep,
    response: Response,
    request: api_requests.ListRequestDep,
    mission: api_requests.Facet = "",
    kind: api_requests.Facet = "",
    verdict: api_requests.Facet = "",
) -> Any:
    """Evidence with what the verifier and the gate said of its packet, newest first."""
    facets = {"mission": mission, "kind": kind, "verdict": verdict}
    found = api_requests.listed(response, console.lists.evidence, "evidence", "/evidence", facets, request)
    return [api_requests.plain(one) for one in found]


@router.get("/evidence/{digest}", responses=BLOB, response_class=Response)
def blob(console: ConsoleDep, digest: Annotated[str, Path(pattern="^[0-9a-f]{64}$")]) -> Response:
    """Blobs by digest, with a type taken from their first bytes. 404 if the bytes do not match."""
    return verified_blob(console, digest)


@router.get("/places", responses=api_requests.answers(Site))
def places(console: ConsoleDep) -> Any:
    """Places, reference routes, passages and zones of the site."""
    return api_requests.plain(console.runtime.site)


@router.get("/templates", responses=api_requests.answers(TaskTemplate, many=True))
def templates(console: ConsoleDep, robot_id: RobotId | None = None) -> Any:
    """Task templates that a new mission of this robot can have: its configuration's, then those beside H_0."""
    return [api_requests.plain(one) for one in offered(console.runtime, robot_id or console.robot())]


@router.get("/providers", responses=api_requests.answers(CapabilityCard, many=True))
def providers(console: ConsoleDep) -> Any:
    """Capability cards as missions were shown them; a provider that no mission was offered yet is not here."""
    console.runtime.memory.catch_up()
    known = [one.record.knowledge for one in console.runtime.memory.semantic(limit=500)]
    cards = {one.card.provider_id: one.card for one in known if isinstance(one, KnownCard)}
    return [api_requests.plain(cards[name]) for name in sorted(cards)]


@router.get("/audit/head", responses=api_requests.answers(LogHead))
def head(console: ConsoleDep) -> Any:
    """The end of the log: keep it elsewhere, and the log is tamper-evident up to there."""
    return api_requests.plain(console.head())


@router.get("/audit/verify", responses=api_requests.answers(LogHead))
def verify(console: ConsoleDep) -> Any:
    """Recompute every hash of the log; 500 with `log_damaged` names the first position that does not verify."""
    return api_requests.plain(console.runtime.verify())


@router.get("/audit/decisions", responses=api_requests.answers(AuditEvent, many=True))
def decisions(
    console: ConsoleDep,
    response: Response,
    actor: Filter = "",
    kind: Filter = "",
    everything: bool = False,
    before: Before = 0,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
) -> Any:
    """Who decided what, when, in which role and by which channel; newest first, below a position."""
    found, scanned = newest_first(console, AuditFilter(actor, kind, everything), before=before, limit=limit)
    if scanned > 1:
        response.headers["Link"] = f'</api/v1/audit/decisions?before={scanned}&limit={limit}>; rel="next"'
    return api_requests.plain(found)


@router.get("/audit/access", responses=api_requests.answers(schemas.TrailEntry, many=True))
def access(
    console: ConsoleDep,
    principal: PrincipalDep,
    actor: Filter = "",
    kind: Filter = "",
    before: Before = 0,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
) -> Any:
    """Sign-ins, changes of accounts and tokens, and every command with the address it came from; newest first."""
    principal.acting("trail")
    store = console.sessions.accounts.store
    return [
        api_requests.plain(one) for one in store.audit_log(before=before or None, kind=kind, actor=actor, limit=limit)
    ]
