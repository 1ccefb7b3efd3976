"""Starting and stopping missions from forms that work without scripts."""

import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from app.i18n.reasons.rendering import sentence
from tests.builders.consoles import Stand, console_stand

START = {
    "template": "warehouse-inspection",
    "robot_id": "vbot-1",
    "goal": "Please look at the office storage area",
    "destination": "office_storage",
    "home": "anchor_a",
}


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def key(operator: TestClient) -> str:
    return re.findall(r'name="key"\s+value="([^"]*)"', operator.get("/missions/new").text)[0]


def test_a_form_starts_a_mission_with_the_persons_own_words(stand: Stand, operator: TestClient) -> None:
    answer = operator.post("/missions", data={**START, "key": key(operator)})
    assert answer.status_code == 303
    (mission,) = stand.harness.runtime.missions()
    assert answer.headers["location"] == f"/missions/{mission.mission_id}"
    assert mission.goal == START["goal"]
    assert mission.requested_by is not None
    assert mission.requested_by.name == "operator"


def test_a_form_that_is_sent_twice_starts_one_mission(stand: Stand, operator: TestClient) -> None:
    form = {**START, "key": key(operator)}
    first, second = operator.post("/missions", data=form), operator.post("/missions", data=form)
    assert first.headers["location"] == second.headers["location"]
    assert len(stand.harness.runtime.missions()) == 1


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("template", "juggling", "no such template"),
        ("robot_id", "vbot-9", "Choose a robot"),
        ("goal", "  ", "Say the goal"),
        ("destination", "atlantis", "atlantis"),
        ("goal", "x" * 2001, "goal"),
    ],
)
def test_a_wrong_form_comes_back_with_what_to_mend_and_starts_nothing(
    stand: Stand, operator: TestClient, field: str, value: str, told: str
) -> None:
    answer = operator.post("/missions", data={**START, "key": key(operator), field: value})
    assert answer.status_code == 422
    assert 'id="errors"' in answer.text
    assert told in answer.text
    assert stand.harness.runtime.missions() == []


def test_every_page_carries_a_stop_that_names_the_robot(stand: Stand, operator: TestClient) -> None:
    mission_id = stand.created()
    for path in ("/", "/missions", "/handoffs", f"/missions/{mission_id}"):
        text = operator.get(path).text
        assert 'action="/robots/vbot-1/stop"' in text, path
        assert "Stop vbot-1" in text, path
        assert "The hardware stop" in text, path


def test_of_two_missions_of_one_robot_the_stop_names_the_one_that_moves_it(stand: Stand, operator: TestClient) -> None:
    moving, queued = stand.driving(), stand.created()
    text = operator.get("/").text
    assert f"vbot-1 runs mission {moving}." in text
    assert f"vbot-1 runs mission {queued}." not in text


def test_a_stop_needs_a_reason_and_is_shown_as_stopping_until_it_is_static(stand: Stand, operator: TestClient) -> None:
    mission_id = stand.driving()
    assert operator.post(f"/missions/{mission_id}/stop", data={"reason": " "}).status_code == 422
    assert stand.harness.runtime.mission(mission_id).status == "active"
    answer = operator.post(f"/missions/{mission_id}/stop", data={"reason": "person in the way"})
    assert answer.status_code == 303
    assert "not acknowledged yet" in sentence(operator.get(f"/missions/{mission_id}/head").text)
    assert "Stopping vbot-1" in operator.get("/overview/bar").text
    ended = stand.harness.supervisor.run(mission_id)
    assert ended.status == "cancelled"
    assert ended.stopped is not None
    assert ended.stopped.static
    text = operator.get(f"/missions/{mission_id}").text
    assert "Stop acknowledged, body static" in text
    assert "person in the way" in text


def test_stopping_what_has_ended_is_refused_with_the_reason(stand: Stand, operator: TestClient) -> None:
    mission_id = stand.created()
    operator.post(f"/missions/{mission_id}/stop", data={"reason": "wrong mission"})
    stand.harness.supervisor.run(mission_id)
    answer = operator.post(f"/missions/{mission_id}/stop", data={"reason": "again"})
    assert answer.status_code == 409
    assert 'id="errors"' in answer.text


def test_the_api_starts_and_stops(stand: Stand) -> None:
    owner = stand.owner()
    begun = owner.post("/api/v1/missions", json={"robot_id": "vbot-1", "template": "circuit"})
    assert begun.status_code == 201
    mission_id = begun.json()["mission_id"]
    assert owner.post(f"/api/v1/missions/{mission_id}/stop", json={"reason": ""}).status_code == 422
    stopped = owner.post(f"/api/v1/missions/{mission_id}/stop", json={"reason": "no longer needed"})
    assert stopped.json()["status"] == "stopping"
    unknown = owner.post("/api/v1/missions", json={"robot_id": "vbot-1", "template": "juggling"})
    assert (unknown.status_code, unknown.json()["code"]) == (404, "unknown_name")
