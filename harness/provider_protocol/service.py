"""Serves a table of operations over HTTP: token, JSON in and out, problems as typed bodies."""

import secrets
from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from harness.contracts.errors import HarnessError
from harness.contracts.reasons import Reason, because, plain
from harness.contracts.values import encode
from harness.provider_protocol.operations import Operation, openapi
from harness.provider_protocol.wire import LONGEST_FACT, Problem, problem, status_of

JSON = "application/json"
LARGEST_BODY = 2 * 1024 * 1024
Endpoint = Callable[[Request], Awaitable[Response]]
Turn = Callable[[], AbstractContextManager[object]]


def provider_service(operations: tuple[Operation, ...], *, token: str, turn: Turn, title: str) -> Starlette:
    """The HTTP service. Calls run inside `turn()`, so that one of them at a time sees the robot, save those apart.

    `/healthz` and `/openapi.json` need no token.
    """
    document = encode(openapi(operations, title))

    async def healthz(request: Request) -> Response:
        return Response(b'{"status":"ok"}', media_type=JSON)

    async def description(request: Request) -> Response:
        return Response(document, media_type=JSON)

    routes = [
        Route("/healthz", healthz, methods=["GET"]),
        Route("/openapi.json", description, methods=["GET"]),
    ]
    for operation in operations:
        endpoint = _endpoint(operation, token=token, turn=turn)
        routes.append(Route(operation.path, endpoint, methods=[operation.method]))
    return Starlette(routes=routes, exception_handlers={HTTPException: _unserved})


def _endpoint(operation: Operation, *, token: str, turn: Turn) -> Endpoint:
    async def endpoint(request: Request) -> Response:
        given = request.headers.get("authorization", "").encode()
        if not secrets.compare_digest(given, f"Bearer {token}".encode()):
            return _refused(401, "unauthorised", because("robot_token_wrong"), where="Authorization")
        raw = await request.body()
        if len(raw) > LARGEST_BODY:
            return _refused(
                413, "too_large", because("request_body_too_large", limit=LARGEST_BODY), where=operation.path
            )
        try:
            body = None if operation.body is None else msgspec.json.decode(raw, type=operation.body)
            names = {**request.query_params, **request.path_params}
            if operation.apart:
                answer = await run_in_threadpool(operation.call, names, body)
            else:
                with turn():
                    answer = operation.call(names, body)
        except msgspec.MsgspecError as error:
            reason = because("request_body_invalid", error=str(error)[:LONGEST_FACT])
            return _refused(422, "invalid_body", reason, where=operation.path)
        except HarnessError as error:
            return _answered(status_of(error), problem(error))
        if operation.answer is bytes:
            return Response(answer, media_type="application/octet-stream")
        return Response(encode(answer), media_type=JSON)

    return endpoint


async def _unserved(request: Request, error: Exception) -> Response:
    """A path or method that the description does not have."""
    assert isinstance(error, HTTPException)
    return JSONResponse({"detail": error.detail}, error.status_code, error.headers)


def _refused(status: int, code: str, reason: Reason, *, where: str) -> Response:
    return _answered(status, Problem(code=code, what=plain(reason), where=where, reason=reason))


def _answered(status: int, wrong: Problem) -> Response:
    return Response(encode(wrong), status_code=status, media_type=JSON)
