"""Starting missions: preview, errors beside their fields, the queue, and running one again."""

import re
from collections.abc import Iterator

import msgspec
import pytest
from fastapi.testclient import TestClient

from app.i18n.reasons.rendering import sentence
from harness.contracts.tasks import TaskContract
from tests.builders.consoles import Stand, console_stand

START = {
    "template": "warehouse-inspection", "robot_id": "vbot-1", "goal": "Please look at the office storage area",
    "destination": "office_storage", "home": "anchor_a",
}  # fmt: skip


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def test_a_preview_shows_the_contract_that_would_be_compiled_and_writes_nothing(
    stand: Stand, operator: TestClient
) -> None:
    head = stand.harness.runtime.head()
    shown = operator.post("/missions/preview", data=START)
    assert shown.status_code == 200
    assert stand.harness.runtime.head() == head
    operator.post("/missions", data=START)
    contract = stand.harness.runtime.missions()[0].contract
    assert contract is not None
    for condition in contract.completion_conditions:
        assert condition.text in shown.text
    assert len(re.findall(r'<tr id="stage-', shown.text)) == len(contract.nodes)
    assert f"{contract.recovery_total} steps for the whole mission" in shown.text
    assert f'value="{START["goal"]}"' in shown.text or START["goal"] in shown.text


def test_a_program_previews_the_contract_that_it_then_starts_and_nothing_is_written(stand: Stand) -> None:
    owner, runtime = stand.owner(), stand.harness.runtime
    asked = {"template": "warehouse-inspection", "arguments": {"destination": "office_storage"}}
    head = runtime.head()
    seen = owner.post("/api/v1/missions/preview", json=asked)
    assert seen.status_code == 200
    assert owner.post("/api/v1/missions/preview", json=asked | {"robot_id": "vbot-9"}).status_code == 404
    lost = owner.post("/api/v1/missions/preview", json=asked | {"arguments": {"destination": "atlantis"}})
    assert (lost.status_code, lost.json()["code"]) == (404, "unknown_name")
    assert runtime.head() == head
    mission_id = owner.post("/api/v1/missions", json=asked).json()["mission_id"]
    mission = runtime.mission(mission_id)
    assert mission.contract is not None
    assert msgspec.convert(seen.json()["contract"], TaskContract) == mission.contract
    assert seen.json()["configuration"] == mission.configuration
    assert seen.json()["longest_s"] == sum(node.timeout_s for node in mission.contract.nodes)


@pytest.mark.parametrize(("field", "value"), [("goal", ""), ("destination", "atlantis"), ("robot_id", "vbot-9")])
@pytest.mark.parametrize("address", ["/missions", "/missions/preview"])
def test_what_is_wrong_stands_beside_its_field(operator: TestClient, address: str, field: str, value: str) -> None:
    answer = operator.post(address, data={**START, field: value})
    assert answer.status_code == 422
    assert f'id="wrong-{field}"' in answer.text
    assert f'aria-describedby="wrong-{field}"' in answer.text


def test_missions_of_a_busy_robot_wait_in_order_and_one_that_has_not_begun_is_taken_back(
    stand: Stand, operator: TestClient
) -> None:
    moving, second, third = stand.driving(), stand.created(), stand.created("circuit")
    page = operator.get("/queue").text
    assert page.index(moving) < page.index(second) < page.index(third)
    assert "This robot first does" in operator.get("/missions/new").text
    assert operator.post(f"/queue/{second}/withdraw", data={"reason": ""}).status_code == 422
    assert operator.post(f"/queue/{second}/withdraw", data={"reason": "not today"}).status_code == 303
    taken = stand.harness.runtime.mission(second)
    assert (taken.status, sentence(taken.reason)) == ("cancelled", "Withdrawn by operator before it began: not today")
    assert stand.harness.starts(second) == ()
    page = operator.get("/queue").text
    assert second not in page
    assert third in page


def test_a_mission_that_has_begun_is_stopped_and_never_taken_back(stand: Stand, operator: TestClient) -> None:
    moving = stand.driving()
    answer = operator.post(f"/queue/{moving}/withdraw", data={"reason": "not today"})
    assert answer.status_code == 409
    assert "Stop it instead" in answer.text
    assert stand.harness.runtime.mission(moving).status == "active"
    api = operator.post(f"/api/v1/missions/{moving}/withdraw", json={"reason": "not today"})
    assert (api.status_code, api.json()["code"]) == (409, "begun")


def test_running_again_fills_in_the_form_and_the_new_mission_names_the_old_one(
    stand: Stand, operator: TestClient
) -> None:
    operator.post("/missions", data=START)
    first = stand.harness.runtime.missions()[0]
    stand.harness.supervisor.run(first.mission_id)
    report = operator.get(f"/missions/{first.mission_id}/report").text
    assert f"/missions/new?rerun_of={first.mission_id}" in report
    form = operator.get(f"/missions/new?rerun_of={first.mission_id}").text
    assert START["goal"] in form
    assert '<option value="office_storage" selected>' in form
    assert "nothing accepted there counts here" in form
    operator.post("/missions", data={**START, "key": "again", "rerun_of": first.mission_id})
    second = stand.harness.runtime.missions()[0]
    assert second.labels == {"rerun_of": first.mission_id}
    assert second.facts == ()
    assert f'href="/missions/{first.mission_id}"' in sentence(operator.get(f"/missions/{second.mission_id}").text)
    assert operator.post("/missions", data={**START, "key": "third", "rerun_of": "msn_none"}).status_code == 404
