"""The API: everything the pages do, problems in one shape, pages of lists, and requests that are sent twice."""

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from tests.builders.consoles import BASE, OWN, OWNER, Stand, console_stand
from tests.builders.people import PASSWORD, everybody, program, store_of

START = {"template": "circuit", "robot_id": "vbot-1"}


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def owner(stand: Stand) -> TestClient:
    return stand.owner()


def under(key: str) -> dict[str, str]:
    return {"Idempotency-Key": key}


# missions ------------------------------------------------------------------------------------------------------------


def test_a_mission_is_started_paused_resumed_and_stopped(stand: Stand, owner: TestClient) -> None:
    mission_id = stand.driving()
    words = {"reason": "lunch"}
    assert owner.post(f"/api/v1/missions/{mission_id}/pause", json=words).json()["status"] == "paused"
    twice = owner.post(f"/api/v1/missions/{mission_id}/pause", json=words)
    assert (twice.status_code, twice.headers["content-type"]) == (409, "application/problem+json")
    assert owner.post(f"/api/v1/missions/{mission_id}/resume", json=words).json()["status"] == "active"
    assert owner.post(f"/api/v1/missions/{mission_id}/stop", json=words).json()["status"] == "stopping"
    kinds = [one["kind"] for one in owner.get(f"/api/v1/missions/{mission_id}/events").json()]
    assert {"MissionPaused", "MissionResumed"} <= set(kinds)


def test_a_list_is_read_page_by_page_whatever_is_started_meanwhile(stand: Stand, owner: TestClient) -> None:
    old = [stand.created() for _ in range(5)]
    seen, address = [], "/api/v1/missions?limit=2"
    while address:
        answer = owner.get(address)
        seen += [one["mission_id"] for one in answer.json()]
        stand.created()
        address = answer.links["next"]["url"] if "next" in answer.links else ""
    assert seen == old[::-1]


def test_a_list_is_filtered_and_a_wrong_place_is_a_problem(stand: Stand, owner: TestClient) -> None:
    stand.created()
    circuit = stand.created("circuit")
    found = owner.get("/api/v1/missions?template=circuit").json()
    assert [one["mission_id"] for one in found] == [circuit]
    assert owner.get("/api/v1/missions?q=storage&template=circuit").json() == []
    assert owner.get("/api/v1/missions?after=nowhere").status_code == 422
    assert owner.get("/api/v1/missions?limit=0").status_code == 422
    assert owner.get("/api/v1/missions?order=sideways").status_code == 422


@pytest.mark.parametrize("listing", ["missions", "handoffs", "evidence"])
def test_every_list_has_the_same_parameters_and_refuses_a_misspelt_one(owner: TestClient, listing: str) -> None:
    assert owner.get(f"/api/v1/{listing}?q=none&order=oldest&limit=3").json() == []
    refused = owner.get(f"/api/v1/{listing}?odrer=oldest")
    assert refused.status_code == 422 and "odrer" in refused.json()["detail"]


def test_evidence_places_templates_and_providers_are_there_to_read(stand: Stand, owner: TestClient) -> None:
    mission = stand.run()
    items = owner.get(f"/api/v1/evidence?mission={mission.mission_id}&kind=image&limit=100").json()
    assert len({one["blob"] for one in items}) >= 8
    picture = owner.get(f"/api/v1/evidence/{items[0]['blob']}")
    assert (picture.status_code, picture.headers["content-type"]) == (200, "image/jpeg")
    assert "office_storage" in {one["place_id"] for one in owner.get("/api/v1/places").json()["places"]}
    assert "warehouse-inspection" in {one["name"] for one in owner.get("/api/v1/templates").json()}
    assert "route-follower" in {one["provider_id"] for one in owner.get("/api/v1/providers").json()}
    head = owner.get("/api/v1/audit/head").json()
    assert owner.get("/api/v1/audit/verify").json() == head
    assert head["position"] == stand.harness.runtime.head().position


def test_who_decided_what_is_there_to_read(stand: Stand, owner: TestClient) -> None:
    owner.post("/api/v1/missions", json=START)
    (entry,) = owner.get("/api/v1/audit/decisions").json()
    assert (entry["kind"], entry["actor"], entry["role"], entry["channel"]) == (
        "MissionCreated",
        "operator",
        "operator",
        "human",
    )
    (entry,) = owner.get("/api/v1/audit/access?kind=command").json()
    assert (entry["kind"], entry["detail"], entry["source"]) == ("command.CreateMission", "accepted", "testclient")


def test_an_unknown_robot_or_template_starts_nothing(stand: Stand, owner: TestClient) -> None:
    for body in ({"robot_id": "vbot-9", "template": "circuit"}, {"template": "juggling"}, {"goal": "x", "extra": 1}):
        answer = owner.post("/api/v1/missions", json=body)
        assert answer.status_code in (404, 422)
        assert set(answer.json()) - {"reason"} == {"type", "title", "status", "detail", "code", "do"}
    assert stand.harness.runtime.missions() == []
    answer = owner.post("/api/v1/missions", json={"robot_id": "vbot-9", "template": "circuit"}).json()
    assert answer["reason"] == {"code": "unknown_robot", "facts": {"robot_id": "vbot-9", "known": ["vbot-1"]}}


# handoffs ------------------------------------------------------------------------------------------------------------


def test_a_person_decides_a_handoff_through_the_api_and_a_program_never(stand: Stand) -> None:
    _, handoff_id = stand.handed_off()
    people = everybody(stand)
    operator, dock = people["operator"], program(stand, "read", "observe", "drive", "stop")
    before = stand.harness.runtime.handoff(handoff_id).cycle
    assert dock.post(f"/api/v1/handoffs/{handoff_id}/look").json()["cycle"] == before + 1
    (shown,) = operator.get("/api/v1/handoffs?status=open").json()
    body = {
        "decision": "reject",
        "reason": "not safe",
        "key": "k",
        "cycle": shown["cycle"],
        "subject": shown["opened"]["subject"],
        "evidence": shown["opened"]["evidence"],
    }
    address = f"/api/v1/handoffs/{handoff_id}/decision"
    refused = dock.post(address, json=body)
    assert (refused.status_code, refused.json()["code"]) == (403, "not_permitted")
    assert operator.post(address, json={**body, "cycle": 0}).status_code == 409
    decided = operator.post(address, json=body)
    assert (decided.status_code, decided.json()["status"]) == (200, "rejected")
    assert operator.post(address, json=body).json() == decided.json()
    late = operator.post(address, json={**body, "decision": "approve", "key": "k2"})
    assert late.status_code == 409
    assert "the-operator" in late.json()["detail"]


# tokens --------------------------------------------------------------------------------------------------------------


def test_a_token_does_what_its_scopes_say_and_for_its_robot_alone(stand: Stand) -> None:
    reader, driver = program(stand, "read"), program(stand, "drive")
    other = program(stand, "read", "drive", "stop", robot_id="vbot-2")
    mission_id = stand.created()
    assert reader.get("/api/v1/missions").status_code == 200
    assert reader.post("/api/v1/missions", json=START).status_code == 403
    assert driver.get("/api/v1/missions").status_code == 403
    assert other.post("/api/v1/missions", json=START).json()["code"] == "not_permitted"
    assert other.post(f"/api/v1/missions/{mission_id}/stop", json={"reason": "x"}).status_code == 403
    assert len(stand.harness.runtime.missions()) == 1
    begun = driver.post("/api/v1/missions", json=START)
    assert begun.status_code == 201
    actor = stand.harness.runtime.mission(begun.json()["mission_id"]).requested_by
    assert actor is not None
    assert (actor.name, actor.role, actor.channel) == ("dock", "integration", "policy")


def test_a_token_is_made_listed_and_revoked_through_the_api(stand: Stand, owner: TestClient) -> None:
    made = owner.post("/api/v1/tokens", json={"name": "dock", "scopes": ["read"]}).json()
    dock = TestClient(stand.app, base_url=BASE, headers={"Authorization": f"Bearer {made['token']}"})
    who = dock.get("/api/v1/account").json()
    assert (who["name"], who["scopes"], who["may"]) == ("dock", ["read"], ["read"])
    (listed,) = owner.get("/api/v1/tokens").json()
    assert "token" not in listed
    assert owner.delete(f"/api/v1/tokens/{made['token_id']}").json()["revoked_at_s"]
    assert dock.get("/api/v1/account").status_code == 401
    assert owner.post("/api/v1/tokens", json={"name": "dock", "scopes": ["decide"]}).status_code == 422


def test_people_are_added_and_changed_through_the_api(stand: Stand) -> None:
    owner = stand.host()
    added = owner.post("/api/v1/accounts", json={"name": "root", "roles": ["admin"], "password": PASSWORD})
    assert added.status_code == 201
    assert set(added.json()) == {"name", "roles", "disabled", "created_at_s", "changed_at_s"}
    assert owner.patch("/api/v1/accounts/root", json={"disabled": True}).status_code == 422
    assert owner.patch("/api/v1/accounts/root", json={"roles": ["admin", "viewer"]}).json()["roles"] == [
        "viewer",
        "admin",
    ]
    again = owner.post("/api/v1/accounts", json={"name": "root", "roles": ["admin"], "password": PASSWORD})
    assert again.status_code == 409
    assert owner.patch("/api/v1/accounts/nobody", json={"disabled": True}).status_code == 404


# the same request twice ----------------------------------------------------------------------------------------------


def test_the_same_request_again_is_the_same_answer_and_starts_nothing(stand: Stand, owner: TestClient) -> None:
    first = owner.post("/api/v1/missions", json=START, headers=under("k"))
    again = owner.post("/api/v1/missions", json=START, headers=under("k"))
    assert (again.status_code, again.json()) == (201, first.json())
    assert again.headers["idempotency-replayed"] == "true"
    assert len(stand.harness.runtime.missions()) == 1


def test_a_key_belongs_to_one_request_and_one_caller(stand: Stand, owner: TestClient) -> None:
    owner.post("/api/v1/missions", json=START, headers=under("k"))
    other = owner.post("/api/v1/missions", json={**START, "seed": 2}, headers=under("k"))
    assert (other.status_code, other.json()["code"]) == (409, "key_reused")
    assert len(stand.harness.runtime.missions()) == 1
    program(stand, "drive").post("/api/v1/missions", json=START, headers=under("k"))
    assert len(stand.harness.runtime.missions()) == 2


def test_a_request_that_was_mended_may_use_its_key_again(owner: TestClient) -> None:
    assert owner.post("/api/v1/missions", json={"template": "juggling"}, headers=under("k")).status_code == 404
    assert owner.post("/api/v1/missions", json=START, headers=under("k")).status_code == 201


def test_a_request_whose_answer_was_lost_is_not_done_again(stand: Stand, owner: TestClient) -> None:
    owner.post("/api/v1/missions", json=START, headers=under("k"))
    store = store_of(stand)
    with store._transaction() as connection:
        connection.exec_driver_sql("UPDATE answers SET status = 0, body = x''")
    lost = owner.post("/api/v1/missions", json=START, headers=under("k"))
    assert (lost.status_code, lost.json()["code"]) == (409, "outcome_unknown")
    assert len(stand.harness.runtime.missions()) == 1


def test_an_answer_with_a_secret_is_not_kept(stand: Stand, owner: TestClient) -> None:
    body = {"name": "dock", "scopes": ["read"]}
    made = owner.post("/api/v1/tokens", json=body, headers=under("k"))
    again = owner.post("/api/v1/tokens", json=body, headers=under("k"))
    assert made.status_code == 201
    assert (again.status_code, again.json()["code"]) == (409, "shown_once")
    assert len(store_of(stand).tokens()) == 1


# beside it -----------------------------------------------------------------------------------------------------------


def test_metrics_say_what_is_so(stand: Stand, owner: TestClient) -> None:
    stand.handed_off()
    stand.created()
    lines = owner.get("/metrics").text.splitlines()
    values = dict(line.split(" ") for line in lines if not line.startswith("#"))
    assert values["regen_log_position"] == str(stand.harness.runtime.head().position)
    assert (values["regen_missions_open"], values["regen_handoffs_open"]) == ("2", "1")
    assert sum(line.startswith("# TYPE") for line in lines) == len(values)
    assert stand.stranger().get("/metrics").status_code == 401


def test_readiness_is_told_to_strangers_and_nothing_else_is(stand: Stand) -> None:
    assert stand.stranger().get("/readyz").text == "ok\n"
    assert stand.stranger().get("/api/v1/openapi.json").status_code == 401
    assert stand.stranger().post("/readyz", headers=OWN).status_code == 405


def test_a_session_needs_our_own_origin_on_the_api_and_a_token_does_not(stand: Stand) -> None:
    people = everybody(stand)
    foreign = {"Origin": "https://elsewhere.example", "Sec-Fetch-Site": "cross-site"}
    assert people["operator"].post("/api/v1/missions", json=START, headers=foreign).status_code == 403
    assert stand.harness.runtime.missions() == []
    bearer = {"Authorization": f"Bearer {OWNER}", **foreign}
    assert stand.stranger().post("/api/v1/missions", json=START, headers=bearer).status_code == 201
