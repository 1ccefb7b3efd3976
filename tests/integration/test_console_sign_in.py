"""Signing in, staying and leaving, what the trail says of it, and the door in front of every route."""

import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from app.auth.accounts import FREE_TRIES
from app.auth.permissions import ROLES
from app.auth.rate_limits import LARGEST_BODY
from app.i18n.reasons.rendering import sentence
from app.settings import ConsoleSettings
from tests.builders.consoles import BASE, FOREIGN, OWN, Stand, console_stand
from tests.builders.people import PASSWORD, browser, everybody, program, standing_watch


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def people(stand: Stand) -> dict[str, TestClient]:
    return everybody(stand)


def test_the_first_link_makes_the_first_account_and_ends(stand: Stand) -> None:
    first = stand.operator()
    assert "Make your account" in first.get("/account").text
    wrong = first.post("/account/people", data={"name": "eve", "roles": ["viewer"], "password": PASSWORD})
    assert wrong.status_code == 422
    assert "must be an admin" in wrong.text
    made = first.post("/account/people", data={"name": "root", "roles": ["admin", "operator"], "password": PASSWORD})
    assert (made.status_code, made.headers["location"]) == (303, "/account/sign-in")
    assert first.get("/").status_code == 401
    assert stand.stranger().get(stand.app.state.sessions.invite()).status_code == 403
    assert browser(stand, "root").get("/").status_code == 200


def test_a_session_is_never_taken_over_from_before_signing_in(stand: Stand, people: dict[str, TestClient]) -> None:
    cookie = stand.app.state.console.settings.cookie
    client = TestClient(stand.app, base_url=BASE, follow_redirects=False, headers=OWN, cookies={cookie: "planted"})
    client.post("/account/sign-in", data={"name": "the-viewer", "password": PASSWORD})
    values = [one.value for one in client.cookies.jar if one.name == cookie]
    assert any(len(value or "") == 43 for value in values)
    stranger = TestClient(stand.app, base_url=BASE, headers=OWN, cookies={cookie: "planted"})
    assert stranger.get("/").status_code == 401


def test_wrong_passwords_are_slowed_down_with_retry_after(stand: Stand, people: dict[str, TestClient]) -> None:
    stranger = people["stranger"]
    standing_watch(stand)
    tries = [
        stranger.post("/account/sign-in", data={"name": "the-viewer", "password": "wrong password"})
        for _ in range(FREE_TRIES + 1)
    ]
    assert [one.status_code for one in tries] == [403] * FREE_TRIES + [429]
    assert tries[-1].headers["retry-after"] == "1"
    assert "Too many wrong passwords" in sentence(tries[-1].text)
    known = stranger.post("/account/sign-in", data={"name": "nobody", "password": "wrong password"})
    assert known.text.replace("nobody", "the-viewer") == tries[0].text, "an unknown name is answered like a known one"


def test_signing_in_from_another_site_is_refused(stand: Stand, people: dict[str, TestClient]) -> None:
    answer = people["stranger"].post(
        "/account/sign-in", data={"name": "the-viewer", "password": PASSWORD}, headers=FOREIGN
    )
    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


def test_a_changed_password_signs_out_the_other_browsers(stand: Stand, people: dict[str, TestClient]) -> None:
    here, there = people["viewer"], browser(stand, "the-viewer")
    form = {"old": PASSWORD, "new": "eight green bottles", "again": "eight green bottles"}
    assert here.post("/account/password", data={**form, "old": "wrong password"}).status_code == 422
    assert here.post("/account/password", data={**form, "again": "other"}).status_code == 422
    assert there.get("/").status_code == 200
    assert here.post("/account/password", data=form).status_code == 200
    assert (here.get("/").status_code, there.get("/").status_code) == (200, 401)
    browser(stand, "the-viewer", "eight green bottles")


def test_a_disabled_person_is_out_at_once_and_signing_out_everywhere_means_everywhere(
    stand: Stand, people: dict[str, TestClient]
) -> None:
    admin = people["admin"]
    assert admin.post("/account/people/the-viewer", data={"do": "disable"}).status_code == 303
    assert people["viewer"].get("/").status_code == 401
    again = browser(stand, "the-operator")
    assert people["operator"].post("/account/sign-out-everywhere").status_code == 303
    assert again.get("/").status_code == 401


def test_the_trail_names_sign_ins_for_those_who_may_read_it(stand: Stand, people: dict[str, TestClient]) -> None:
    text = people["reviewer"].get("/audit/access?kind=sign_in").text
    assert text.count("sign_in.accepted") == len(ROLES)
    assert "testclient" in text
    assert "intact" in sentence(people["reviewer"].get("/audit/access?verify=true").text)
    assert "Every hash of the log" in sentence(people["viewer"].get("/audit?verify=true").text)


def test_the_audit_reads_on_from_where_a_page_ended(stand: Stand, people: dict[str, TestClient]) -> None:
    stand.run()
    page, positions = people["viewer"].get("/audit?everything=true").text, []
    while True:
        positions += [int(one) for one in re.findall(r'<td class="mono" title="[0-9a-f]{64}">(\d+)</td>', page)]
        older = re.findall(r'href="(/audit\?[^"]*before=[^"]*)"', page)
        if not older:
            break
        page = people["viewer"].get(older[0].replace("&amp;", "&")).text
    assert positions == list(range(stand.harness.runtime.head().position, 0, -1))


def test_a_body_that_is_too_large_is_refused_however_it_comes(stand: Stand, people: dict[str, TestClient]) -> None:
    large = b"x" * (LARGEST_BODY + 1)
    operator = people["operator"]
    assert operator.post("/missions", content=large).status_code == 413
    pieces = (b"goal=" + b"x" * 65536 for _ in range(20))
    headers = {"Content-Type": "application/x-www-form-urlencoded"}
    assert operator.post("/missions", content=pieces, headers=headers).status_code == 413
    assert operator.post("/missions", content=b"", headers={"Content-Length": "-1"}).status_code == 413
    assert stand.harness.runtime.missions() == []


def test_a_caller_that_asks_too_fast_is_told_when_to_go_on() -> None:
    settings = ConsoleSettings(port=8000, stranger_rate_per_s=0.01, stranger_rate_burst=3)
    with console_stand(settings=settings) as stand:
        stranger = stand.stranger()
        answers = [stranger.get("/healthz") for _ in range(4)]
        assert [one.status_code for one in answers] == [200, 200, 200, 429]
        assert 60 < int(answers[-1].headers["retry-after"]) <= 100
        assert stranger.get("/static/css/base.css").status_code == 200


def test_a_page_takes_no_token_and_a_cookie_beside_a_wrong_token_does_not_help(
    stand: Stand, people: dict[str, TestClient]
) -> None:
    token = program(stand, "read")
    assert token.get("/api/v1/missions").status_code == 200
    assert token.get("/metrics").status_code == 200
    assert token.get("/missions").status_code == 401
    wrong = people["operator"].get("/api/v1/missions", headers={"Authorization": "Bearer regen_wrong"})
    assert wrong.status_code == 401
