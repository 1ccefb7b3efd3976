"""Signing in, and every route against every role: who may see, who may change, and what is stored of it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import pytest
from fastapi.testclient import TestClient

from app.accounts import FREE_TRIES
from app.limits import LARGEST_BODY
from app.permissions import GRANTS, ROLES, Permission
from app.settings import ConsoleSettings
from harness.contracts.ids import MissionId
from harness.contracts.values import encode
from rsi_reviews.desk import Desk
from tests.builders.consoles import BASE, FOREIGN, OWN, Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, browser, counted, everybody, program, store_of
from tests.builders.releases import LAUNCHER, candidate, expect, say, tried

OPEN = {"/healthz", "/readyz", "/account/sign-in"}
READ: dict[str, Permission] = {
    "/account/people": "people",
    "/api/v1/accounts": "people",
    "/api/v1/tokens": "people",
    "/missions/{mission_id}/scene/export.{form}": "export",
    "/missions/{mission_id}/dossier": "export",
    "/audit/access": "trail",
    "/api/v1/audit/access": "trail",
}
"""What not everybody may read; everything else every role may."""

ENDLESS = {"/live", "/api/v1/events"}
OWN_BUSINESS = {
    "/account/sign-out",
    "/account/sign-out-everywhere",
    "/account/password",
    "/missions/{mission_id}/scene/{view}/instant",
    "/candidates/check",
}
TURNS = ("claim", "release", "on-my-way", "choose", "take-over", "hand-back", "close")
ALERT_TURNS = ("acknowledge", "shelve", "suppress", "restore", "assign")
ROBOT_TURNS: dict[str, Permission] = {"autonomy": "drive", "pause": "stop", "resume": "drive", "safe": "stop"}
CHANGE: dict[tuple[str, str], Permission] = {
    ("POST", "/missions"): "drive",
    ("POST", "/missions/{mission_id}/stop"): "stop",
    ("POST", "/handoffs/{handoff_id}/look"): "observe",
    ("POST", "/handoffs/{handoff_id}/decision"): "decide",
    **{("POST", f"{door}/handoffs/{{handoff_id}}/{turn}"): "decide" for door in ("", "/api/v1") for turn in TURNS},
    **{("POST", f"{door}/handoffs/{{handoff_id}}/attest"): "attest" for door in ("", "/api/v1")},
    **{("POST", f"/robots/{{robot_id}}/{turn}"): needed for turn, needed in ROBOT_TURNS.items()},
    ("POST", "/robots/stop"): "stop",
    ("POST", "/robots/autonomy"): "drive",
    ("POST", "/robots/{robot_id}/stand"): "drive",
    ("POST", "/robots/{robot_id}/drive"): "drive",
    ("POST", "/robots/{robot_id}/drive/turn"): "drive",
    ("POST", "/robots/{robot_id}/drive/return"): "stop",
    ("POST", "/api/v1/robots/stop"): "stop",
    ("POST", "/api/v1/control/autonomy"): "drive",
    ("POST", "/api/v1/missions/{mission_id}/autonomy"): "drive",
    ("POST", "/api/v1/robots/{robot_id}/safe"): "stop",
    ("POST", "/api/v1/robots/{robot_id}/posture"): "drive",
    ("POST", "/api/v1/robots/{robot_id}/wheel"): "drive",
    ("POST", "/api/v1/robots/{robot_id}/wheel/turn"): "drive",
    ("POST", "/api/v1/robots/{robot_id}/wheel/return"): "stop",
    **{("POST", f"{door}/alerts/{{alert_id}}/{turn}"): "alerts" for door in ("", "/api/v1") for turn in ALERT_TURNS},
    ("POST", "/api/v1/places/{place_id}"): "drive",
    ("POST", "/api/v1/places/{place_id}/remove"): "drive",
    ("POST", "/places/new"): "drive",
    ("POST", "/places/{place_id}/edit"): "drive",
    ("POST", "/places/{place_id}/remove"): "drive",
    ("POST", "/missions/preview"): "drive",
    ("POST", "/missions/{mission_id}/facts/{packet_id}/{condition_id}/dispute"): "dispute",
    ("POST", "/account/people"): "people",
    ("POST", "/account/people/{name}"): "people",
    ("POST", "/account/tokens"): "people",
    ("POST", "/account/tokens/{token_id}/revoke"): "people",
    ("POST", "/api/v1/missions"): "drive",
    ("POST", "/api/v1/missions/{mission_id}/stop"): "stop",
    ("POST", "/api/v1/missions/{mission_id}/pause"): "stop",
    ("POST", "/api/v1/missions/{mission_id}/resume"): "drive",
    ("POST", "/api/v1/missions/{mission_id}/facts/{condition_id}/dispute"): "dispute",
    ("POST", "/missions/{mission_id}/case"): "dispute",
    ("POST", "/api/v1/maps/{map_version}/cloud"): "drive",
    ("POST", "/api/v1/missions/{mission_id}/case"): "dispute",
    ("POST", "/api/v1/handoffs/{handoff_id}/look"): "observe",
    ("POST", "/api/v1/handoffs/{handoff_id}/decision"): "decide",
    ("POST", "/api/v1/accounts"): "people",
    ("PATCH", "/api/v1/accounts/{name}"): "people",
    ("POST", "/api/v1/tokens"): "people",
    ("DELETE", "/api/v1/tokens/{token_id}"): "people",
    ("POST", "/api/v1/sign-in-links"): "people",
    ("POST", "/queue/{mission_id}/withdraw"): "stop",
    ("POST", "/api/v1/missions/{mission_id}/withdraw"): "stop",
    **{("POST", f"{door}/candidates"): "propose" for door in ("", "/api/v1")},
    **{("POST", f"{door}/candidates/{{candidate}}/{{word}}"): "propose" for door in ("", "/api/v1")},
    **{("POST", f"{door}/releases/policy"): "people" for door in ("", "/api/v1")},
}
"""What every changing route needs. A route that is not here fails the test: say who may use it."""


REASONED = ("stop", "pause", "resume", "dispute", "withdraw", "case")


@dataclass(frozen=True)
class House:
    """A console with a mission that ended, one under way, a question, and somebody of every role."""

    stand: Stand
    people: dict[str, TestClient]
    mission_id: MissionId
    handoff_id: str
    token_id: str
    alert_id: str = "alert_1"
    candidate: str = "none"

    def address(self, path: str) -> str:
        names = {
            "mission_id": self.mission_id,
            "handoff_id": self.handoff_id,
            "token_id": self.token_id,
            "alert_id": self.alert_id,
            "place_id": "office_storage",
            "name": "somebody",
            "robot_id": "vbot-1",
            "digest": "0" * 64,
            "position": "1",
            "form": "viser",
            "candidate": self.candidate,
            "word": "comment",
        }
        return re.sub(r"\{(\w+)(:\w+)?\}", lambda found: names.get(found[1], "1"), path)

    def body(self, path: str) -> dict[str, object]:
        """Well-formed words for a changing route, so that only who asks decides."""
        handoff = self.stand.harness.runtime.handoff(self.handoff_id)  # type: ignore[arg-type]
        assert handoff.opened is not None
        last = path.rsplit("/", 1)[-1]
        if last in ("missions", "preview"):
            return {"template": "circuit", "robot_id": "vbot-1", "goal": "Walk the circuit", "key": "k1"}
        if last == "decision":
            return {
                "decision": "reject",
                "reason": "not safe",
                "key": "k2",
                "cycle": handoff.cycle,
                "subject": handoff.opened.subject,
                "evidence": handoff.opened.evidence,
            }
        if last == "dispute" and not path.startswith("/api/"):
            return {"reason": "because", "from": "report"}
        if path == "/api/v1/places/{place_id}":
            return {"name": "Office", "x_m": 1.0, "y_m": 1.0, "reason": "because"}
        if path == "/api/v1/places/{place_id}/remove":
            return {"basis": 7, "reason": "because"}
        if last in ALERT_TURNS or path.startswith("/places/"):
            return self.looked_after(last)
        if last in (*TURNS, "attest"):
            return self.turn(last, handoff.cycle, api=path.startswith("/api/"))
        if last in ("people", "accounts"):
            return {"name": "newcomer", "roles": ["viewer"], "password": PASSWORD}
        if last == "{word}":
            return {"reason": "because", "key": "k3"}
        if last == "candidates":
            return proposal(api=path.startswith("/api/"))
        if last == "cloud":
            corner = [0.0, 0.0, 0.0]
            place = {"origin_m": corner, "low_m": corner, "high_m": corner, "points": 0, "dropped": 0, "chunks": []}
            named = {"map_version": "1", "frame": "map", "source": "a.pcd", "source_digest": "0" * 64}
            return {"cloud": {**named, **place}, "reason": "because"}
        if last == "policy":
            kept = {} if path.startswith("/api/") else {"key": "k4"}
            return {"kind": "two_person", "quorum": 1, "reason": "because", **kept}
        if last == "tokens":
            return {"name": "newcomer", "scopes": ["read"]}
        if last == "{name}":
            return {"roles": ["viewer"]}
        if last in ("autonomy", "safe", "stand", "posture", "wheel", "drive", "turn", "return"):
            return self.at_robot(last)
        return {"reason": "because"} if last in REASONED else {}

    def looked_after(self, last: str) -> dict[str, object]:
        """Well-formed words for an alert or a place."""
        place = {"name": "Bay", "x": "1", "y": "1", "heading": "0", "verification": "configured", "reason": "because"}
        known: dict[str, dict[str, object]] = {
            "acknowledge": {"seen": 1},
            "shelve": {"reason": "because", "for_s": 900},
            "suppress": {"reason": "because"},
            "assign": {"assignee": "eve"},
            "new": {**place, "place_id": "bay_1"},
            "edit": {**place, "name": "Office", "basis": "0"},
            "remove": {"reason": "because", "basis": "1"},
        }
        return known.get(last, {})

    def at_robot(self, last: str) -> dict[str, object]:
        """Well-formed words for what is asked of a robot."""
        known: dict[str, dict[str, object]] = {
            "autonomy": {"autonomy": "manual", "reason": "because"},
            "posture": {"posture": "standing", "reason": "because"},
            "turn": {"session": "s", "v_mps": 0.1},
        }
        return known.get(last, {"reason": "because"})

    def turn(self, last: str, cycle: int, *, api: bool) -> dict[str, object]:
        """Well-formed words for a turn at a handoff."""
        known: dict[str, dict[str, object]] = {
            "on-my-way": {"reason": "because"},
            "choose": {"action": "retry", "cycle": cycle},
            "take-over": {"claim": "t", "device": "desk", "key": "k", "reason": "because"},
            "hand-back": {"claim": "t", "key": "k", "reason": "because"},
            "close": {"claim": "t", "key": "k", "reason": "because"},
            "attest": {"condition_id": "c", "statement" if api else "reason": "because", "key": "k", "cycle": cycle},
        }
        return known.get(last, {"claim": "t"})

    def send(self, who: str, method: str, path: str) -> int:
        client, address, body = self.people[who], self.address(path), dict(self.body(path))
        if method == "GET":
            return client.get(address).status_code
        if path.startswith("/api/") or path.endswith("/turn"):
            body.pop("key", None) if path.endswith("/missions") else None
            return client.request(method, address, json=body).status_code
        return client.request(method, address, data=body).status_code


def proposal(*, api: bool) -> dict[str, object]:
    """A candidate that may be proposed, as the form or as the API takes it."""
    if api:
        made = candidate(tried(wait_s=7.0))
        return {"configuration": encode(made.configuration).decode(), "manifest": encode(made.manifest).decode()}
    manifest = {"reason": "because", "intended_effect": "less waiting", "metric": "recovery_cost"}
    return {**manifest, "smallest_effect": "0.1", "by": "fields", "recovery.wait_s": "8"}


def routes(stand: Stand) -> list[tuple[str, str]]:
    """(method, path) of every route of the running application."""
    found = []
    for route in stand.app.routes:
        for inner in getattr(getattr(route, "original_router", None), "routes", [route]):
            methods = getattr(inner, "methods", None) or set()
            found += [(method, inner.path) for method in sorted(methods) if method not in ("HEAD", "OPTIONS")]
    return found


@pytest.fixture(scope="module")
def house() -> Iterator[House]:
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        people = everybody(stand)
        program(stand, "read")
        stand.app.state.doors.accounts.add("somebody", roles=["viewer"], password=PASSWORD, by=SETTING_UP)
        token_id = store_of(stand).tokens()[0].token_id
        stand.app.state.alert_watch.step()
        ((alert_id, _),) = stand.app.state.alert_watch.alerts.all()
        made = candidate()
        expect(Desk(stand.harness.runtime).propose(made, say(LAUNCHER)))
        yield House(stand, people, stand.created(), handoff_id, token_id, alert_id, made.candidate_id)


def test_the_matrix_knows_every_route(house: House) -> None:
    found = routes(house.stand)
    assert len(found) > 60
    changing = {one for one in found if one[0] != "GET" and one[1] not in OPEN | OWN_BUSINESS}
    assert changing == set(CHANGE)
    assert set(READ) <= {path for method, path in found if method == "GET"}


@pytest.mark.parametrize("role", [*ROLES, "stranger"])
def test_every_reading_route_answers_exactly_those_who_may_read_it(house: House, role: str) -> None:
    seen = 0
    for method, path in routes(house.stand):
        if method != "GET" or path in ENDLESS:
            continue
        status = house.send(role, method, path)
        if path in OPEN:
            assert status == 200, path
        elif role == "stranger":
            assert status == 401, path
        elif role not in GRANTS[READ.get(path, "read")]:
            assert status == 403, path
        else:
            assert status in (200, 404), path
        seen += 1
    assert seen > 40


@pytest.mark.parametrize("role", [*ROLES, "stranger"])
def test_every_changing_route_refuses_whoever_may_not_and_nothing_happens(house: House, role: str) -> None:
    with counted(house.stand):
        for (method, path), permission in CHANGE.items():
            if role not in GRANTS[permission]:
                assert house.send(role, method, path) == (401 if role == "stranger" else 403), (method, path)


def test_every_changing_route_serves_whoever_may(house: House) -> None:
    served = {}
    for (method, path), permission in CHANGE.items():
        status = house.send(GRANTS[permission][0], method, path)
        served[method, path] = status
        assert status in (200, 201, 303, 409), (method, path, status)
    assert sum(status < 400 for status in served.values()) > len(served) / 3, served


def test_a_decision_is_stored_with_who_in_which_role_by_which_channel() -> None:
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        people = everybody(stand)
        text = people["operator"].get(f"/handoffs/{handoff_id}").text
        fields = {
            name: re.findall(rf'name="{name}" value="([^"]*)"', text)[0]
            for name in ("cycle", "subject", "evidence", "key")
        }
        form = {**fields, "decision": "reject", "reason": "not safe"}
        assert people["viewer"].post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 403
        assert people["admin"].post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 403
        assert stand.harness.runtime.handoff(handoff_id).status == "open"
        assert people["operator"].post(f"/handoffs/{handoff_id}/decision", data=form).status_code == 303
        answer = stand.harness.runtime.handoff(handoff_id).answer
        assert answer is not None
        assert (answer.actor.name, answer.actor.role, answer.actor.channel) == ("the-operator", "operator", "human")
        entry = store_of(stand).trail(kind="command.DecideHandoff")[0]
        assert (entry.actor, entry.subject, entry.detail, entry.source) == (
            "the-operator", f"handoff/{handoff_id}", "accepted", "testclient",
        )  # fmt: skip
        audit = people["viewer"].get("/audit?actor=the-operator").text
        assert "HandoffRejected" in audit
        assert "operator, human" in audit
        assert "not safe" in audit


def test_the_page_hides_what_would_be_refused_and_the_command_refuses_it_anyway(house: House) -> None:
    seen_by = {role: house.people[role].get("/missions").text for role in ("viewer", "operator")}
    assert 'href="/missions/new"' in seen_by["operator"]
    assert "watching: " in seen_by["viewer"]
    assert f'action="/missions/{house.mission_id}/stop"' not in seen_by["viewer"]
    rail = house.people["viewer"].get("/overview/rail").text
    assert "/missions/new" not in rail


# signing in ----------------------------------------------------------------------------------------------------------


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
    assert stand.stranger().get(stand.app.state.doors.invite()).status_code == 403
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
    tries = [
        stranger.post("/account/sign-in", data={"name": "the-viewer", "password": "wrong password"})
        for _ in range(FREE_TRIES + 1)
    ]
    assert [one.status_code for one in tries] == [403] * FREE_TRIES + [429]
    assert int(tries[-1].headers["retry-after"]) >= 1
    assert "Too many wrong passwords" in tries[-1].text
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
    assert "intact" in people["reviewer"].get("/audit/access?verify=true").text
    assert "Every hash of the log" in people["viewer"].get("/audit?verify=true").text


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


# the door ------------------------------------------------------------------------------------------------------------


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
    settings = ConsoleSettings(port=8000, stranger_rate_per_s=0.5, stranger_rate_burst=3)
    with console_stand(settings=settings) as stand:
        stranger = stand.stranger()
        answers = [stranger.get("/healthz") for _ in range(4)]
        assert [one.status_code for one in answers] == [200, 200, 200, 429]
        assert answers[-1].headers["retry-after"] == "2"
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


def test_no_secret_stands_in_an_event_a_page_the_accounts_or_a_log(
    stand: Stand, people: dict[str, TestClient], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(0)
    secret = "regen_" + "unguessable secret of a token"
    admin, operator = people["admin"], people["operator"]
    made = admin.post("/account/tokens", data={"name": "dock", "scopes": ["read", "drive"]})
    secret = re.findall(r"<pre>(regen_[^<]+)</pre>", made.text)[0]
    dock = TestClient(stand.app, base_url=BASE, headers={"Authorization": f"Bearer {secret}"})
    assert dock.post("/api/v1/missions", json={"template": "circuit"}).status_code == 201
    admin.post(
        "/account/password", data={"old": "old secret phrase", "new": "new secret phrase", "again": "new secret phrase"}
    )
    cookies = [one.value or "-" for client in people.values() for one in client.cookies.jar]
    secrets = [secret, PASSWORD, "old secret phrase", "new secret phrase", "owner-token", *cookies]
    assert len(cookies) == len(ROLES)
    pages = [
        who.get(House(stand, people, MissionId("m"), "h", "t").address(path)).text
        for who in (admin, operator)
        for method, path in routes(stand)
        if method == "GET" and path not in ENDLESS
    ]
    events = [msgspec.json.encode(one).decode() for one in stand.harness.runtime.log(0, 10_000)]
    raw = store_of(stand)._engine.raw_connection()
    kept = "\n".join(raw.driver_connection.iterdump())  # type: ignore[union-attr]
    assert len(pages) > 80
    for told in (*pages, *events, kept, caplog.text):
        assert [one for one in secrets if one in told] == []
