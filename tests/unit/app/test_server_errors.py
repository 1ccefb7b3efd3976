"""What nobody foresaw is answered like every other failure, and logged."""

import logging
from collections.abc import AsyncIterator

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import StreamingResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from app.web.server_errors import ServerErrorMiddleware


async def broken(request: Request) -> StreamingResponse:
    raise ZeroDivisionError(f"nobody thought of {request.url.path}")


async def half(_request: Request) -> StreamingResponse:
    async def told() -> AsyncIterator[bytes]:
        yield b"half of"
        raise ZeroDivisionError("the line is cut")

    return StreamingResponse(told())


@pytest.fixture
def client() -> TestClient:
    routes = [Route(path, broken) for path in ("/missions", "/api/v1/missions")]
    app = Starlette(routes=[*routes, Route("/half", half)])
    app.add_middleware(ServerErrorMiddleware)
    return TestClient(app)


def test_a_person_reads_that_nothing_is_lost_and_whom_to_ask(
    client: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        answer = client.get("/missions")
    assert answer.status_code == 500
    assert "The console failed to answer" in answer.text and "Nothing that was recorded is lost" in answer.text
    assert "nobody thought of" not in answer.text
    assert "path=/missions" in caplog.text and "nobody thought of /missions" in caplog.text


def test_a_program_gets_a_problem_document(client: TestClient) -> None:
    answer = client.get("/api/v1/missions")
    assert (answer.status_code, answer.headers["content-type"]) == (500, "application/problem+json")
    assert answer.json()["code"] == "unexpected"


def test_an_answer_that_has_begun_is_cut_and_never_completed(client: TestClient) -> None:
    with pytest.raises(ZeroDivisionError, match="the line is cut"):
        client.get("/half")
