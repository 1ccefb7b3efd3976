"""/api/v1/events: the log as server-sent events; an event's id is its position, so a reader misses none."""

from collections.abc import AsyncIterator
from typing import Annotated, Any

import msgspec
from fastapi import APIRouter, Header, Query
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from app.console import Console, ConsoleDep
from app.routes.api_requests import CHECKED, PROBLEMS
from harness.contracts.ports import StoredEvent
from harness.contracts.upcasting import name_of

router = APIRouter(prefix="/api/v1", responses=PROBLEMS, dependencies=CHECKED, tags=["events"])
BATCH = 500
TOPICS = ("mission/", "handoff/", "lease/")
STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "`id` is the log position, `event` the kind, `data` a LogEvent as JSON.",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}


@router.get("/events", responses=STREAM, response_class=StreamingResponse)
async def events(
    console: ConsoleDep,
    after: Annotated[int | None, Query(ge=0, le=2**53)] = None,
    stream: Annotated[str, Query(max_length=200, description="Only streams that begin so: mission/msn_x")] = "",
    last_event_id: Annotated[str, Header(pattern="^[0-9]{0,15}$")] = "",
) -> StreamingResponse:
    """From `Last-Event-ID`, else from `after`, else from now on; then every event as it is committed."""
    since = int(last_event_id) if last_event_id else after
    begin = (await run_in_threadpool(console.head)).position if since is None else since
    return StreamingResponse(
        frames(console, begin, stream), media_type="text/event-stream", headers={"X-Accel-Buffering": "no"}
    )


async def frames(console: Console, after: int, prefix: str) -> AsyncIterator[str]:
    """Frames until the client leaves or the console stops. It subscribes before it reads, so none is missed."""
    subscription = console.broker.subscribe(TOPICS)
    try:
        yield "retry: 1000\n\n"
        names = subscription.names()
        while True:
            stored = await run_in_threadpool(console.runtime.log, after, BATCH)
            for one in stored:
                if one.stream.startswith(prefix):
                    yield frame(one)
            after = stored[-1].position if stored else after
            if len(stored) == BATCH:
                continue
            async for name in names:
                if name:
                    break
                yield ": beat\n\n"
            else:
                return
    finally:
        console.broker.unsubscribe(subscription)


def frame(stored: StoredEvent) -> str:
    """One event; JSON has no line breaks, so one data line holds it."""
    body = msgspec.json.encode(
        {
            "position": stored.position,
            "stream": stored.stream,
            "version": stored.version,
            "kind": stored.kind,
            "mission_s": stored.mission_s,
            "recorded_s": stored.recorded_s,
            "previous": stored.previous,
            "digest": stored.digest,
            "event": msgspec.Raw(stored.body),
        }
    ).decode()
    return f"id: {stored.position}\nevent: {name_of(stored.kind)}\ndata: {body}\n\n"
