"""Every route against every role: who may see, who may change, and what is stored of it."""

import re
from collections.abc import Iterator

import msgspec
import pytest
from fastapi.testclient import TestClient

from app.acts import releases
from app.auth.command_permissions import required_permission
from app.auth.permissions import GRANTS, ROLES, Permission
from harness.contracts.ids import MissionId
from rsi_reviews.release_service import ReleaseService
from tests.builders.console_with_roles import ALERT_TURNS, TURNS, ConsoleWithRoles, routes
from tests.builders.consoles import BASE, Stand, console_stand
from tests.builders.people import PASSWORD, SETTING_UP, counted, everybody, program, store_of
from tests.builders.releases import LAUNCHER, candidate, expect, say

OPEN = {"/healthz", "/readyz", "/account/sign-in"}
ISSUERS = {"/account/oidc", "/account/oidc/back", "/account/oidc/leave"}
"""The ways to an identity provider and back: open to everybody, and nowhere while none is set up."""
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
    "/account/terminal",
    "/missions/{mission_id}/scene/{view}/instant",
    "/candidates/check",
    "/candidates/knobs",
    "/audit/anchors",
}
ROBOT_TURNS: dict[str, Permission] = {"autonomy": "drive", "pause": "stop", "resume": "drive", "safe": "stop"}
EVALUATION = ("evaluate", "cancel-evaluation")
TELEOPERATION = ("teleoperation", "wheel")
"""The path of the API, and its name in the release before, kept as a hidden alias."""
CHANGE: dict[tuple[str, str], Permission] = {
    ("POST", "/missions"): "drive",
    ("POST", "/missions/{mission_id}/stop"): "stop",
    ("POST", "/queue/goals/{proposal_id}/dismiss"): "drive",
    ("POST", "/api/v1/goal-proposals"): "suggest",
    ("POST", "/api/v1/goal-proposals/{proposal_id}/dismiss"): "drive",
    ("POST", "/handoffs/{handoff_id}/look"): "observe",
    ("POST", "/handoffs/{handoff_id}/decision"): "decide",
    **{("POST", f"{door}/handoffs/{{handoff_id}}/{turn}"): "decide" for door in ("", "/api/v1") for turn in TURNS},
    **{("POST", f"{door}/handoffs/{{handoff_id}}/attest"): "attest" for door in ("", "/api/v1")},
    ("POST", "/handoffs/{handoff_id}/pause"): "stop",
    ("POST", "/handoffs/{handoff_id}/resume"): "drive",
    **{("POST", f"/robots/{{robot_id}}/{turn}"): needed for turn, needed in ROBOT_TURNS.items()},
    ("POST", "/robots/stop"): "stop",
    **{("POST", f"{door}/robots/{{robot_id}}/stop"): "stop" for door in ("", "/api/v1")},
    **{("POST", f"{door}/robots/{{robot_id}}/stop/reason"): "stop" for door in ("", "/api/v1")},
    ("POST", "/robots/{robot_id}/release"): "drive",
    ("POST", "/robots/{robot_id}/simulation/clear-way"): "drive",
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
    **{("POST", f"/api/v1/robots/{{robot_id}}/{path}"): "drive" for path in TELEOPERATION},
    **{("POST", f"/api/v1/robots/{{robot_id}}/{path}/turn"): "drive" for path in TELEOPERATION},
    **{("POST", f"/api/v1/robots/{{robot_id}}/{path}/return"): "stop" for path in TELEOPERATION},
    **{("POST", f"{door}/alerts/{{alert_id}}/{turn}"): "alerts" for door in ("", "/api/v1") for turn in ALERT_TURNS},
    ("POST", "/api/v1/leases/{resource:path}/free"): "drive",
    ("POST", "/api/v1/places/{place_id}"): "drive",
    ("POST", "/api/v1/places/{place_id}/remove"): "drive",
    ("POST", "/places/new"): "drive",
    ("POST", "/places/{place_id}/edit"): "drive",
    ("POST", "/places/{place_id}/remove"): "drive",
    ("POST", "/api/v1/routes/{name}"): "drive",
    ("POST", "/api/v1/routes/{name}/remove"): "drive",
    ("POST", "/routes/new"): "drive",
    ("POST", "/routes/{name}/edit"): "drive",
    ("POST", "/routes/{name}/remove"): "drive",
    ("POST", "/api/v1/own-missions/{name}"): "drive",
    ("POST", "/api/v1/own-missions/{name}/remove"): "drive",
    ("POST", "/own-missions/new"): "drive",
    ("POST", "/api/v1/own-robots/{name}"): "robots",
    ("POST", "/api/v1/own-robots/{name}/remove"): "robots",
    ("POST", "/own-robots/new"): "robots",
    ("POST", "/own-robots/{name}/edit"): "robots",
    ("POST", "/own-robots/{name}/remove"): "robots",
    ("POST", "/own-missions/{name}/edit"): "drive",
    ("POST", "/own-missions/{name}/remove"): "drive",
    **{("POST", f"{door}/missions/preview"): "drive" for door in ("", "/api/v1")},
    ("POST", "/api/v1/candidates/check"): "propose",
    ("POST", "/missions/{mission_id}/facts/{packet_id}/{condition_id}/dispute"): "dispute",
    ("POST", "/account/people"): "people",
    ("POST", "/account/people/{name}"): "people",
    ("POST", "/account/tokens"): "people",
    ("POST", "/account/tokens/{token_id}/revoke"): "people",
    ("POST", "/api/v1/missions"): "drive",
    ("POST", "/api/v1/recordings"): "drive",
    ("POST", "/api/v1/uploads"): "drive",
    ("POST", "/api/v1/uploads/{upload_id}"): "drive",
    ("DELETE", "/api/v1/uploads/{upload_id}"): "drive",
    **{("POST", f"/api/v1/uploads/{{upload_id}}/{turn}"): "drive" for turn in ("replay", "cloud", "map")},
    ("DELETE", "/api/v1/replays/{job_id}"): "drive",
    ("POST", "/recordings"): "drive",
    **{("POST", f"/recordings/{{upload_id}}/{turn}"): "drive" for turn in ("replay", "cloud", "map", "remove")},
    ("POST", "/recordings/replays/{job_id}/cancel"): "drive",
    ("POST", "/api/v1/robots/{robot_id}/checks"): "drive",
    ("POST", "/api/v1/missions/{mission_id}/stop"): "stop",
    ("POST", "/api/v1/missions/{mission_id}/pause"): "stop",
    ("POST", "/api/v1/missions/{mission_id}/resume"): "drive",
    ("POST", "/api/v1/missions/{mission_id}/facts/{condition_id}/dispute"): "dispute",
    ("POST", "/missions/{mission_id}/case"): "dispute",
    ("POST", "/api/v1/maps/{map_version}/cloud"): "drive",
    **{("POST", f"/api/v1/speech{rest}"): "drive" for rest in ("", "/{stream}", "/{stream}/end")},
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
    **{
        ("POST", f"/api/v1/candidates/{{candidate}}/{verb}"): required_permission(kind.becomes)
        for verb, kind in releases.ACTS.items()
    },
    ("POST", "/candidates/{candidate}/{verb}"): "propose",
    **{
        ("POST", f"{door}/candidates/{{candidate}}/{verb}"): "propose"
        for door in ("", "/api/v1")
        for verb in EVALUATION
    },
    ("POST", "/api/v1/candidates/{candidate}/request_changes"): "review",
    **{("POST", f"{door}/releases/policy"): "policy" for door in ("", "/api/v1")},
    **{("POST", f"{door}/evidence/{{digest}}/erase"): "erase" for door in ("", "/api/v1")},
}
"""What every changing route needs. A route that is not here fails the test: say who may use it."""
ELSEWHERE = {
    "/robots/{robot_id}/simulation/clear-way": 404,
    "/api/v1/recordings": 422,
    **dict.fromkeys(("/api/v1/speech/{stream}", "/api/v1/speech/{stream}/end"), 404),
}
"""Where whoever may is answered, but not served here: no simulated world is connected, no body is a recording, and
nobody is speaking."""


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleWithRoles]:
    with console_stand(folder=tmp_path_factory.mktemp("data")) as stand:
        _, handoff_id = stand.handed_off()
        people = everybody(stand)
        program(stand, "read")
        stand.app.state.sessions.accounts.add("somebody", roles=["viewer"], password=PASSWORD, by=SETTING_UP)
        token_id = store_of(stand).tokens()[0].token_id
        stand.app.state.alert_watch.step()
        ((alert_id, _),) = stand.app.state.alert_watch.alerts.all()
        made = candidate()
        expect(ReleaseService(stand.harness.runtime).propose(made, say(LAUNCHER)))
        yield ConsoleWithRoles(stand, people, stand.created(), handoff_id, token_id, alert_id, made.candidate_id)


def test_the_matrix_knows_every_route(console: ConsoleWithRoles) -> None:
    found = routes(console.stand)
    assert len(found) > 60
    changing = {one for one in found if one[0] != "GET" and one[1] not in OPEN | OWN_BUSINESS}
    assert changing == set(CHANGE)
    assert set(READ) <= {path for method, path in found if method == "GET"}


@pytest.mark.parametrize("role", [*ROLES, "stranger"])
def test_every_reading_route_answers_exactly_those_who_may_read_it(console: ConsoleWithRoles, role: str) -> None:
    seen = 0
    for method, path in routes(console.stand):
        if method != "GET" or path in ENDLESS:
            continue
        status = console.send(role, method, path)
        if path in OPEN:
            assert status == 200, path
        elif path in ISSUERS:
            assert status == 404, path
        elif role == "stranger":
            assert status == 401, path
        elif role not in GRANTS[READ.get(path, "read")]:
            assert status == 403, path
        else:
            assert status in (200, 404), path
        seen += 1
    assert seen > 40


@pytest.mark.parametrize("role", [*ROLES, "stranger"])
def test_every_changing_route_refuses_whoever_may_not_and_nothing_happens(console: ConsoleWithRoles, role: str) -> None:
    with counted(console.stand):
        for (method, path), permission in CHANGE.items():
            if role not in GRANTS[permission]:
                assert console.send(role, method, path) == (401 if role == "stranger" else 403), (method, path)


def test_every_changing_route_serves_whoever_may(console: ConsoleWithRoles) -> None:
    served = {}
    for (method, path), permission in CHANGE.items():
        status = console.send(GRANTS[permission][0], method, path)
        served[method, path] = status
        assert status in (200, 201, 202, 303, 409) or ELSEWHERE.get(path) == status, (method, path, status)
    assert sum(status < 400 for status in served.values()) > len(served) / 3, served


@pytest.mark.ask("temporalio/ui#2413")
def test_a_decision_is_stored_with_who_in_which_role_by_which_channel() -> None:
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        people = everybody(stand)
        text = people["operator"].get(f"/handoffs/{handoff_id}").text
        fields = {
            name: re.findall(rf'name="{name}"\s+value="([^"]*)"', text)[0]
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
        entry = store_of(stand).audit_log(kind="command.RejectHandoff")[0]
        assert (entry.actor, entry.subject, entry.detail, entry.source) == (
            "the-operator", f"handoff/{handoff_id}", "accepted", "testclient",
        )  # fmt: skip
        audit = people["viewer"].get("/audit?actor=the-operator").text
        assert "HandoffRejected" in audit
        assert re.search(r"operator,\s+human", audit)
        assert "not safe" in audit


def test_the_page_hides_what_would_be_refused_and_the_command_refuses_it_anyway(console: ConsoleWithRoles) -> None:
    seen_by = {role: console.people[role].get("/missions").text for role in ("viewer", "operator")}
    assert 'href="/missions/new"' in seen_by["operator"]
    assert "watching: " in seen_by["viewer"]
    assert f'action="/missions/{console.mission_id}/stop"' not in seen_by["viewer"]
    rail = console.people["viewer"].get("/overview/rail").text
    assert "/missions/new" not in rail


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def people(stand: Stand) -> dict[str, TestClient]:
    return everybody(stand)


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
        who.get(ConsoleWithRoles(stand, people, MissionId("m"), "h", "t").address(path)).text
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
