"""The OpenAPI 3.1 description at /api/v1/openapi.json, derived from the structs that the API answers with."""

from typing import Any

import msgspec
from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.requests import Request
from starlette.responses import JSONResponse

from app.routes.api_requests import ANSWERED

PATH = "/api/v1/openapi.json"


def document(app: FastAPI) -> dict[str, Any]:
    """The whole description."""
    described: dict[str, Any] = get_openapi(
        title="RegenHarness console",
        version="1",
        description="Everything the pages can do. Commands go to the gate; failures are problem documents (RFC 9457).",
        routes=app.routes,
    )
    shapes = sorted(ANSWERED, key=lambda kind: kind.__name__)
    _, answered = msgspec.json.schema_components(shapes, ref_template="#/components/schemas/{name}")
    components = described.setdefault("components", {})
    components["schemas"] = {**components.get("schemas", {}), **answered}
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
