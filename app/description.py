"""The API's own description, OpenAPI 3.1, at /api/v1/openapi.json: shapes come from the contracts themselves."""

from typing import Any

import msgspec
from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.requests import Request
from starlette.responses import JSONResponse

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.exploration import TargetAnswer, TargetQuestion
from harness.contracts.maps import MapCloud
from harness.contracts.places import Site
from harness.contracts.ports import Head
from harness.contracts.protocol import DriveReport, RobotStatus
from harness.contracts.read_models import EvidenceItem
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.projections.exploration import ExplorationDecision
from harness.projections.handoffs import Handoff
from rsi_reviews.contracts import HeldOutAnswer, ReleasePolicy
from rsi_reviews.growth import CaseAdded

PATH = "/api/v1/openapi.json"
CONTRACTS = (
    CapabilityCard,
    CaseAdded,
    EvidenceItem,
    ExplorationDecision,
    Handoff,
    Head,
    MapCloud,
    Site,
    TargetAnswer,
    TargetQuestion,
    TaskContract,
    TaskTemplate,
    DriveReport,
    RobotStatus,
)
REVIEWED = (HeldOutAnswer, ReleasePolicy)
TEXT: dict[str, Any] = {"type": "string"}
NUMBER: dict[str, Any] = {"type": "number"}
COUNT: dict[str, Any] = {"type": "integer", "minimum": 0}
FLAG: dict[str, Any] = {"type": "boolean"}
OBJECT: dict[str, Any] = {"type": "object"}
SPENT: dict[str, Any] = {
    "type": "object",
    "required": ["spent", "remaining"],
    "properties": {"spent": COUNT, "remaining": COUNT},
}


def _maybe(schema: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


def _many(schema: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": schema}


def _record(description: str, **properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "object",
        "description": description,
        "required": list(properties),
        "properties": properties,
        "additionalProperties": False,
    }


def _besides(record: dict[str, Any], **optional: dict[str, Any]) -> dict[str, Any]:
    """The record with properties that may be missing."""
    return record | {"properties": record["properties"] | optional}


MISSION = {"mission_id": TEXT, "robot_id": TEXT, "goal": TEXT, "template": TEXT, "status": TEXT}
EVENT = {
    "position": COUNT,
    "version": COUNT,
    "kind": TEXT,
    "mission_s": NUMBER,
    "recorded_s": NUMBER,
    "previous": TEXT,
    "digest": TEXT,
    "event": OBJECT,
}
CANDIDATE = {
    "candidate": TEXT,
    "status": TEXT,
    "component": TEXT,
    "metric": TEXT,
    "author": TEXT,
    "cycle": COUNT,
    "configuration": TEXT,
    "baseline": TEXT,
}
TOKEN = {
    "token_id": TEXT,
    "name": TEXT,
    "scopes": _many(TEXT),
    "robot_id": TEXT,
    "created_by": TEXT,
    "created_at_s": NUMBER,
    "expires_at_s": _maybe(NUMBER),
    "used_at_s": _maybe(NUMBER),
    "revoked_at_s": _maybe(NUMBER),
}
ALERT = {
    "alert_id": TEXT,
    "title": TEXT,
    "text": TEXT,
    "kind": TEXT,
    "state": TEXT,
    "priority": TEXT,
    "count": COUNT,
    "total": COUNT,
    "first_s": NUMBER,
    "last_s": NUMBER,
    "assignee": TEXT,
    "put_away": TEXT,
    "shelved_until_s": _maybe(NUMBER),
    "link": TEXT,
}
SHAPES: dict[str, dict[str, Any]] = {
    "Problem": _besides(
        _record(
            "RFC 9457. `code` is the slug for machines, `do` what can be done now; `changes` since what was answered.",
            type=TEXT,
            title=TEXT,
            status=COUNT,
            detail=TEXT,
            code=TEXT,
            do=TEXT,
        ),
        changes=_many(_record("What is not as it was shown.", name=TEXT, was=TEXT, now=TEXT)),
        rule=TEXT,
        reason=_record("Of a refusal: code and facts of what `detail` says.", code=TEXT, facts=OBJECT),
    ),
    "MissionSummary": _record(
        "One mission in a list. Times are wall seconds since the Unix epoch.",
        **MISSION,
        stage=TEXT,
        goal_verdict=_maybe(TEXT),
        state_version=COUNT,
        handoff_id=_maybe(TEXT),
        began_s=NUMBER,
        ended_s=_maybe(NUMBER),
        recovery=SPENT,
    ),
    "MissionOutcome": _record(
        "What became of a mission: declared by providers, measured by the harness, accepted by the gate.",
        **MISSION,
        goal_verdict=_maybe(TEXT),
        reason=TEXT,
        report=TEXT,
        state_version=COUNT,
        configuration=TEXT,
        seed=COUNT,
        labels=OBJECT,
        handoff_id=_maybe(TEXT),
        stages=_many(OBJECT),
        segments=_many(OBJECT),
        images=_many(OBJECT),
        findings=_many(OBJECT),
        receipts=_many(OBJECT),
        recovery=SPENT,
        dispatches=COUNT,
        physical_starts=_maybe(COUNT),
        duplicate_starts=_maybe(COUNT),
        events=COUNT,
    )
    | {"additionalProperties": True},
    "MissionPreview": _record(
        "What a mission would be: its contract, compiled and not stored. `longest_s` is the sum of its time limits.",
        robot_id=TEXT,
        configuration=TEXT,
        highest_risk=TEXT,
        longest_s=NUMBER,
        stages=_many(TEXT),
        contract={"$ref": "#/components/schemas/TaskContract"},
    ),
    "LogEvent": _record("One event with its place in the hash chain.", **EVENT) | {"additionalProperties": True},
    "Deed": _record(
        "One event, and who asked for it.",
        position=COUNT,
        at_s=NUMBER,
        kind=TEXT,
        stream=TEXT,
        mission_id=TEXT,
        robot_id=TEXT,
        actor=TEXT,
        role=TEXT,
        channel=TEXT,
        reason=TEXT,
        digest=TEXT,
    ),
    "TrailEntry": _record(
        "One line of the access trail, a hash chain of its own.",
        number=COUNT,
        at_s=NUMBER,
        kind=TEXT,
        actor=TEXT,
        role=TEXT,
        subject=TEXT,
        detail=TEXT,
        source=TEXT,
        previous=TEXT,
        digest=TEXT,
    ),
    "Visitor": _record(
        "Who a caller is.", name=TEXT, roles=_many(TEXT), scopes=_many(TEXT), robot_id=_maybe(TEXT), may=_many(TEXT)
    ),
    "Account": _record(
        "One person.", name=TEXT, roles=_many(TEXT), disabled=FLAG, created_at_s=NUMBER, changed_at_s=NUMBER
    ),
    "Token": _record("One token, without its secret.", **TOKEN),
    "IssuedToken": _record("A new token: `token` is shown this once.", **TOKEN, token=TEXT),
    "Robot": _record(
        "One robot: what it declares of itself with the age of its word, its mission, and who is in control.",
        robot_id=TEXT,
        status=_maybe({"$ref": "#/components/schemas/RobotStatus"}),
        link_age_s=_maybe(NUMBER),
        trouble=TEXT,
        mission_id=_maybe(TEXT),
        mission_status=_maybe(TEXT),
        handoff_id=_maybe(TEXT),
        autonomy=_maybe(TEXT),
        queued=COUNT,
        driver=_maybe(TEXT),
        watchers=_many(TEXT),
    ),
    "HouseControl": _record(
        "The limit of autonomy that holds for every mission.", autonomy=TEXT, limited_by=_maybe(TEXT), reason=TEXT
    ),
    "StopsAsked": _record(
        "Missions that were asked to stop; `refused` says why others were not.", asked=_many(TEXT), refused=_many(TEXT)
    ),
    "WheelSession": _record("Who drives a robot by hand.", robot_id=TEXT, session=TEXT, driver=TEXT, device=TEXT),
    "AlertSummary": _record("One alert: everything with one cause. Times are wall seconds.", **ALERT),
    "Alert": _record(
        "One alert with what lasts and its history, newest first.",
        **ALERT,
        conditions=_many(TEXT),
        history=_many(_record("One line of its history.", at_s=NUMBER, text=TEXT, position=COUNT)),
    ),
    "CandidateSummary": _record("A proposed change to the harness itself.", **CANDIDATE),
    "Candidate": _record(
        "A candidate with what a decision needs; a decision names `digest` and `cycle`.",
        **CANDIDATE,
        digest=TEXT,
        manifest=_maybe(OBJECT),
        authors=_many(TEXT),
        clauses=_many(OBJECT),
        approvals=_many(TEXT),
        said=_many(OBJECT),
        canary=_many(OBJECT),
        canary_outcome=TEXT,
        reason=TEXT,
    ),
    "Refusal": _record(
        "One thing a candidate may not do: the rule, where it stands, what it was and would become, and why not.",
        rule=TEXT,
        path=TEXT,
        message=TEXT,
        reason=_record("Code and facts of the message.", code=TEXT, facts=OBJECT),
        old=TEXT,
        new=TEXT,
    ),
    "CandidateCheck": _record(
        "What the static check says of a candidate that was not stored. `holds`: it breaks no rule.",
        candidate=TEXT,
        holds=FLAG,
        refusals=_many({"$ref": "#/components/schemas/Refusal"}),
        difference={"$ref": "#/components/schemas/ConfigurationDifference"},
    ),
    "ConfigurationDifference": _record("By component, and raw.", changes=_many(OBJECT), raw=TEXT),
    "Results": _record(
        "What an evaluation measured. `better_by` is positive where the candidate is better.",
        pairs=COUNT,
        safety_pairs=COUNT,
        pass_to_fail=_many(OBJECT),
        pass_to_fail_total=COUNT,
        fail_to_pass=_many(OBJECT),
        fail_to_pass_total=COUNT,
        families=_many(
            _record(
                "Pairs of one family, with the 95 % interval of their difference.",
                family=TEXT,
                n=COUNT,
                baseline=NUMBER,
                candidate=NUMBER,
                better_by=NUMBER,
                low=NUMBER,
                high=NUMBER,
            )
        ),
        held_out=_maybe({"$ref": "#/components/schemas/HeldOutAnswer"}),
        seconds=NUMBER,
    ),
    "Replay": _record(
        "Stored decisions derived again under a candidate.",
        missions=COUNT,
        decisions=COUNT,
        differing=_many(_record("One mission.", mission_id=TEXT, differences=_many(OBJECT))),
    ),
    "Releases": _record(
        "The pointer to what new missions run under.",
        revision=COUNT,
        configuration=TEXT,
        canary=_maybe(TEXT),
        canary_robot=_maybe(TEXT),
        current_at=_maybe(TEXT),
        history=_many(OBJECT),
        versions=OBJECT,
        pins=OBJECT,
        quarantined=_many(OBJECT),
        looks=_many(OBJECT),
        uptakes=_many(OBJECT),
        policy={"$ref": "#/components/schemas/ReleasePolicy"},
    ),
    "ExplorationChoice": _record(
        "One target of an exploring mission. `question` and `answer` are null where their records are not kept.",
        decision={"$ref": "#/components/schemas/ExplorationDecision"},
        question=_maybe({"$ref": "#/components/schemas/TargetQuestion"}),
        answer=_maybe({"$ref": "#/components/schemas/TargetAnswer"}),
    ),
    "SignInLink": _record("A link that lets one person in once.", url=TEXT),
}


def document(app: FastAPI) -> dict[str, Any]:
    """The whole description."""
    described: dict[str, Any] = get_openapi(
        title="RegenHarness console",
        version="1",
        description="Everything the pages can do. Commands go to the gate; failures are problem documents (RFC 9457).",
        routes=app.routes,
    )
    _, contracts = msgspec.json.schema_components((*CONTRACTS, *REVIEWED), ref_template="#/components/schemas/{name}")
    components = described.setdefault("components", {})
    components["schemas"] = {**components.get("schemas", {}), **contracts, **SHAPES}
    components["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
    described["security"] = [{"token": []}]
    for operations in described["paths"].values():
        for method, operation in operations.items():
            if method in ("post", "patch", "delete"):
                operation.setdefault("parameters", []).append(IDEMPOTENCY)
    return described


IDEMPOTENCY = {
    "name": "Idempotency-Key",
    "in": "header",
    "required": False,
    "description": "The same key with the same request is answered as the first time, and does nothing.",
    "schema": {"type": "string", "minLength": 1, "maxLength": 200, "pattern": "^[!-~]+$"},
}


def install(app: FastAPI) -> None:
    """Serve the description to whoever may use the API; it is made once, when it is first asked for."""
    made: list[dict[str, Any]] = []

    async def describe(request: Request) -> JSONResponse:
        if not made:
            made.append(document(app))
        return JSONResponse(made[0])

    app.add_route(PATH, describe, include_in_schema=False)
