"""The HTTP provider protocol as a table of operations, from which both the service and its OpenAPI text are made.

Any robot in any language can speak it: bodies are JSON of the contract structs, a bearer token guards all of it.
"""

import re
from collections.abc import Callable
from typing import Any, Literal

import msgspec

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import ProviderFailed, UnknownName
from harness.contracts.ids import Digest, RequestId
from harness.contracts.ports import Provider, Robot
from harness.contracts.protocol import (
    MOST_CHANGES,
    STACK_PROTOCOL,
    InvocationReport,
    Observations,
    PhysicalStart,
    RobotStatus,
    StackGoals,
    StartRequest,
)
from harness.contracts.reasons import because
from harness.contracts.values import Value
from harness.provider_protocol.wire import Problem

VERSION = f"{STACK_PROTOCOL}.0"
MOST_SAMPLES = 20_000
Names = dict[str, str]


class Keepalive(Value):
    """The answer to a keepalive: the handle it was for."""

    handle: str


class Operation(msgspec.Struct, frozen=True):
    """One endpoint. `call` takes path and query parameters and the decoded body; `answer` bytes means raw bytes.

    `query` may be left out and are whole numbers; `instants` must be given, in seconds of mission time. `apart`: it
    runs on a thread of its own, and not in the turn that the others share.
    """

    method: Literal["GET", "POST"]
    path: str
    summary: str
    answer: Any
    call: Callable[[Names, Any], Any]
    body: Any = None
    query: tuple[str, ...] = ()
    instants: tuple[str, ...] = ()
    apart: bool = False


def provider_operations(robot: Robot) -> tuple[Operation, ...]:
    """The operations that every robot serves."""

    def cards(names: Names, body: None) -> list[CapabilityCard]:
        return [provider.card for provider in robot.providers()]

    def start(names: Names, body: StartRequest) -> InvocationReport:
        return _provider(robot, names["provider_id"]).start(body)

    def find(names: Names, body: None) -> InvocationReport:
        return _found(robot, RequestId(names["request_id"]))

    def observations(names: Names, body: None) -> Observations:
        after, limit = _whole(names, "after", 0), _whole(names, "limit", 5000)
        return robot.observations(after, limit=min(limit, MOST_SAMPLES))

    def keepalive(names: Names, body: None) -> Keepalive:
        _holder(robot, names["handle"]).keepalive(names["handle"])
        return Keepalive(handle=names["handle"])

    handle = "/invocations/{handle}"
    return (
        Operation("GET", "/robot", "The robot's condition", RobotStatus, lambda names, body: robot.status()),
        Operation("GET", "/providers", "Capability cards", list[CapabilityCard], cards),
        Operation(
            "POST", "/providers/{provider_id}/invocations", "Start, once per request id", InvocationReport, start,
            body=StartRequest,
        ),
        Operation(
            "GET", handle, "An invocation now", InvocationReport,
            lambda names, body: _holder(robot, names["handle"]).report(names["handle"]),
        ),
        Operation("GET", "/requests/{request_id}", "The invocation of a request, or 404", InvocationReport, find),
        Operation("POST", f"{handle}/keepalive", "The supervisor is still there", Keepalive, keepalive),
        Operation(
            "POST", f"{handle}/resume", "Go on after a lost keepalive", InvocationReport,
            lambda names, body: _holder(robot, names["handle"]).resume(names["handle"]),
        ),
        Operation(
            "POST", f"{handle}/stop", "Stop; `cancelled` only once it stands", InvocationReport,
            lambda names, body: _holder(robot, names["handle"]).stop(names["handle"]),
        ),
        Operation(
            "GET", "/observations", "Samples after a sequence number", Observations, observations,
            query=("after", "limit"),
        ),
        Operation(
            "GET", "/blobs/{digest}", "Bytes by SHA-256", bytes,
            lambda names, body: robot.blob(Digest(names["digest"])),
        ),
        Operation(
            "GET", "/starts", "The robot's own start journal", list[PhysicalStart],
            lambda names, body: list(robot.starts()),
        ),
    )  # fmt: skip


def stack_operations(changes: Callable[[int, int], StackGoals]) -> tuple[Operation, ...]:
    """The operation of a robot whose own stack decides, for a harness that only observes it (protocol 1.2). `changes`:
    those after a sequence number, so many at most."""

    def goals(names: Names, body: None) -> StackGoals:
        after, limit = _whole(names, "after", 0), _whole(names, "limit", MOST_CHANGES)
        return changes(after, min(limit, MOST_CHANGES))

    return (
        Operation(
            "GET", "/stack/goals", "What the robot's own stack was given to do, and how it says that ended", StackGoals,
            goals, query=("after", "limit"),
        ),
    )  # fmt: skip


def openapi(operations: tuple[Operation, ...], title: str) -> dict[str, Any]:
    """The OpenAPI 3.1 document of these operations; schemas come from the contract structs."""
    kinds = [kind for op in operations for kind in (op.body, op.answer) if kind not in (None, bytes)] + [Problem]
    schemas, components = msgspec.json.schema_components(kinds, ref_template="#/components/schemas/{name}")
    named = {str(kind): schema for kind, schema in zip(kinds, schemas, strict=True)}
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        paths.setdefault(operation.path, {})[operation.method.lower()] = _described(operation, named)
    return {
        "openapi": "3.1.0",
        "info": {"title": title, "version": VERSION},
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
        "security": [{"token": []}],
    }


def _described(operation: Operation, named: dict[str, Any]) -> dict[str, Any]:
    raw = operation.answer is bytes
    content = (
        {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}
        if raw
        else {"application/json": {"schema": named[str(operation.answer)]}}
    )
    wrong = {"description": "A problem", "content": {"application/json": {"schema": named[str(Problem)]}}}
    parameters = [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
        for name in re.findall(r"{(\w+)}", operation.path)
    ]
    parameters += [
        {"name": name, "in": "query", "schema": {"type": "integer", "minimum": 0}} for name in operation.query
    ]
    parameters += [
        {"name": name, "in": "query", "required": True, "schema": {"type": "number"}} for name in operation.instants
    ]
    described: dict[str, Any] = {
        "summary": operation.summary,
        "parameters": parameters,
        "responses": {"200": {"description": "Done", "content": content}, "default": wrong},
    }
    if operation.body is not None:
        schema = named[str(operation.body)]
        described["requestBody"] = {"required": True, "content": {"application/json": {"schema": schema}}}
    return described


def _provider(robot: Robot, provider_id: str) -> Provider:
    for provider in robot.providers():
        if provider.card.provider_id == provider_id:
            return provider
    raise UnknownName(because("provider_not_here", provider_id=provider_id[:80]))


def _holder(robot: Robot, handle: str) -> Provider:
    """The provider that knows a handle; raises ProviderFailed if none does."""
    unknown: ProviderFailed | None = None
    for provider in robot.providers():
        try:
            provider.report(handle)
        except ProviderFailed as error:
            unknown = error
        else:
            return provider
    raise unknown or UnknownName(because("providers_not_here"))


def _found(robot: Robot, request: RequestId) -> InvocationReport:
    for provider in robot.providers():
        report = provider.find(request)
        if report is not None:
            return report
    raise UnknownName(because("request_never_came", request_id=request[:80]))


def _whole(names: Names, name: str, default: int) -> int:
    text = names.get(name, str(default))
    if not text.isdecimal():
        raise msgspec.ValidationError(f"Expected a whole number - at `${name}`")
    return int(text)
