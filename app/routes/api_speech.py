"""/api/v1/speech: a goal while it is spoken, in the chunks that a microphone gives; its words so far start nothing."""

from typing import Any

from fastapi import Request
from starlette.concurrency import run_in_threadpool

from app.console import ConsoleDep
from app.routes import api_mission_schemas as schemas
from app.routes import api_requests
from app.web.security import PrincipalDep

SAMPLES = {"type": "string", "contentMediaType": "application/octet-stream"}
router = api_requests.router("missions", under="/speech")


@router.post("", status_code=201, responses=api_requests.answers(schemas.SpeechOpened, status=201))
def begin(console: ConsoleDep, principal: PrincipalDep) -> Any:
    """Open a stream for what a person is about to say; an earlier one of theirs ends."""
    actor = principal.acting("drive")
    return api_requests.plain(schemas.SpeechOpened(stream=console.speech.begin(actor.name)))


@router.post(
    "/{stream}",
    responses=api_requests.answers(schemas.SpeechHeard),
    openapi_extra={"requestBody": {"required": True, "content": {"application/octet-stream": {"schema": SAMPLES}}}},
)
async def feed(console: ConsoleDep, principal: PrincipalDep, stream: str, request: Request) -> Any:
    """A chunk of 16-bit little-endian mono samples of 16 kHz; the answer is what was heard so far."""
    actor = principal.acting("drive")
    words = await run_in_threadpool(console.speech.feed, stream, actor.name, await request.body())
    return api_requests.plain(schemas.SpeechHeard(partial=words))


@router.post("/{stream}/end", status_code=201, responses=api_requests.answers(schemas.RecordingHeard, status=201))
def end(console: ConsoleDep, principal: PrincipalDep, stream: str) -> Any:
    """The person has spoken: all of it is stored as a recording and written down twice, as POST /recordings does."""
    actor = principal.acting("drive")
    _, recording = console.speech.finish(stream, actor.name)
    transcription = console.runtime.hear(recording)
    found = schemas.as_answered(transcription)
    return api_requests.plain(found)
