"""Static files: kept for ever under their content's address, compared anew under any other, and without a cookie."""

import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient
from msgspec.structs import replace

from harness.contracts.ids import sha256
from tests.builders.consoles import Stand, console_stand


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def test_what_a_page_loads_is_kept_for_ever(operator: TestClient) -> None:
    addresses = re.findall(r"/static/[^\"]+\?v=\w+", operator.get("/").text)
    assert len(addresses) > 10
    for address in addresses:
        answer = operator.get(address)
        assert answer.status_code == 200
        assert answer.headers["cache-control"] == "public, max-age=31536000, immutable", address


@pytest.mark.parametrize("query", ["", "?v=", "?v=00000000", "?v=1&v=2", "?w=1"])
def test_under_any_other_address_a_file_is_compared_by_its_etag(operator: TestClient, query: str) -> None:
    first = operator.get(f"/static/css/base.css{query}")
    assert (first.status_code, first.headers["cache-control"]) == (200, "no-cache")
    again = operator.get(f"/static/css/base.css{query}", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content, again.headers["cache-control"]) == (304, b"", "no-cache")


def test_a_page_itself_is_never_kept(operator: TestClient) -> None:
    assert operator.get("/").headers["cache-control"] == "no-store"
    assert operator.get("/static/css/none.css?v=1").headers["cache-control"] == "no-store"


def test_a_kept_file_brings_no_cookie_of_anybody(stand: Stand) -> None:
    operator, store = stand.operator(), stand.app.state.sessions.accounts.store
    digest = sha256(next(iter(operator.cookies.values())).encode())
    session = store.session(digest)
    assert session is not None and store.change_session(digest, replace(session, rotated_at_s=0.0))
    assert "set-cookie" not in operator.get("/static/css/base.css").headers
    assert "set-cookie" in operator.get("/places").headers
