"""/live: one stream of change signals per page; /healthz: whether the console answers, without signing in."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import PlainTextResponse, StreamingResponse

from app.console import ActorDep, Console, ConsoleDep

router = APIRouter()
TOPICS = 40


@router.get("/live")
async def live(
    console: ConsoleDep, actor: ActorDep, topic: Annotated[list[str], Query(max_length=TOPICS)]
) -> StreamingResponse:
    """Server-sent events: `hello` with the log's position, then `changed` with a name, and `beat` in between.

    `joined` tells how many changes of a name were told as one so far, whenever that has grown.
    """
    return StreamingResponse(
        present(console, actor.name, tuple(topic)), media_type="text/event-stream", headers={"X-Accel-Buffering": "no"}
    )


async def present(console: Console, name: str, topics: tuple[str, ...]) -> AsyncIterator[str]:
    """The stream of one page; as long as it runs, its reader counts as present."""
    with console.presence.here(name, topics):
        async for frame in stream(console, topics):
            yield frame


async def stream(console: Console, topics: tuple[str, ...]) -> AsyncIterator[str]:
    """Frames of the stream until the reader leaves or the broker closes."""
    subscription, joined = console.broker.subscribe(topics), 0
    try:
        yield f"retry: 500\nevent: hello\ndata: {console.head().position}\n\n"
        async for name in subscription.names():
            yield f"event: changed\ndata: {name}\n\n" if name else "event: beat\ndata: \n\n"
            if subscription.joined > joined:
                joined = subscription.joined
                yield f"event: joined\ndata: {joined}\n\n"
    finally:
        console.broker.unsubscribe(subscription)


@router.get("/healthz")
def healthz() -> PlainTextResponse:
    return PlainTextResponse("ok\n")
