"""What keeps a session awake: what a person does, by htmx too; never what a page that stands open does by itself."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from msgspec.structs import replace
from starlette.requests import HTTPConnection

from app.web.security import by_a_person
from tests.builders.consoles import Stand, console_stand
from tests.builders.people import store_of

HTMX = {"HX-Request": "true", "Sec-Fetch-Dest": "empty", "Sec-Fetch-Mode": "cors"}
AGO_S = 3600.0


@pytest.fixture(scope="module")
def asking() -> Iterator[tuple[Stand, TestClient, str]]:
    """A console, somebody signed in, and a question that waits for a person."""
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        yield stand, stand.operator(), handoff_id


def wakes(stand: Stand, client: TestClient, method: str, path: str, **sent: Any) -> bool:
    """Whether this request counted as the person's, an hour after the last that did."""
    store = store_of(stand)
    session = store.sessions("operator")[0]
    before = replace(session, seen_at_s=session.began_at_s - AGO_S)
    assert store.change_session(session.digest, before)
    answer = client.request(method, path, **sent)
    assert answer.status_code < 400, (path, answer.status_code)
    after = store.sessions("operator")[0].seen_at_s
    assert after == before.seen_at_s or after >= session.began_at_s
    return after != before.seen_at_s


def token(client: TestClient, path: str) -> str:
    """What the page's own claim form sends."""
    return re.findall(r'name="claim"\s+value="([^"]+)"', client.get(path).text)[0]


def test_claiming_and_deciding_count_as_the_persons_own_by_htmx_and_without(
    asking: tuple[Stand, TestClient, str],
) -> None:
    stand, client, handoff_id = asking
    path = f"/handoffs/{handoff_id}"
    assert wakes(stand, client, "POST", f"{path}/claim", headers=HTMX, data={"claim": token(client, path)})
    assert wakes(stand, client, "POST", f"{path}/on-my-way", headers=HTMX)
    assert wakes(stand, client, "POST", f"{path}/look", headers={"Sec-Fetch-Dest": "document"})
    assert wakes(stand, client, "GET", path, headers={"Sec-Fetch-Dest": "document", "Sec-Fetch-Mode": "navigate"})
    assert wakes(stand, client, "GET", path), "a browser that says nothing of the kind"


def test_what_an_open_page_fetches_by_itself_does_not_count(asking: tuple[Stand, TestClient, str]) -> None:
    stand, client, handoff_id = asking
    assert not wakes(stand, client, "GET", "/robots/vbot-1/now", headers=HTMX)
    assert not wakes(stand, client, "GET", f"/handoffs/{handoff_id}/question", headers=HTMX)
    assert not wakes(stand, client, "GET", "/robots/vbot-1/camera.jpg", headers={"Sec-Fetch-Dest": "image"})
    assert not wakes(stand, client, "GET", "/missions", headers={"Sec-Fetch-Dest": "iframe"})


def test_a_claim_that_its_page_renews_does_not_count_and_holds(asking: tuple[Stand, TestClient, str]) -> None:
    stand, client, handoff_id = asking
    path = f"/handoffs/{handoff_id}"
    claim = {"claim": token(client, path)}
    assert wakes(stand, client, "POST", f"{path}/claim", data=claim)
    before = stand.harness.runtime.handoff(handoff_id).claim
    assert before is not None
    assert not wakes(stand, client, "POST", f"{path}/claim", headers={"X-By-Itself": "yes"}, data=claim)
    kept = stand.harness.runtime.handoff(handoff_id).claim
    assert kept is not None
    assert (kept.claim, kept.until_at_s >= before.until_at_s) == (before.claim, True)


def connection(kind: str, path: str, method: str = "GET") -> HTTPConnection:
    scope = {"type": kind, "path": path, "headers": []}
    return HTTPConnection(scope if kind == "websocket" else {**scope, "method": method})


def test_streams_sockets_and_views_that_follow_do_not_count() -> None:
    assert not by_a_person(connection("http", "/live"))
    assert not by_a_person(connection("websocket", "/missions/msn_1/scene/v1"))
    assert not by_a_person(connection("http", "/missions/msn_1/scene/v1/instant", "POST"))
    assert by_a_person(connection("http", "/missions/msn_1/stop", "POST"))
