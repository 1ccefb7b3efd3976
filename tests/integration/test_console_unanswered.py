"""The report for programs says what was meant, done and measured where nobody answered, as the page does."""

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient
from pydantic import SecretStr

from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.builders.retreating import ASKS, LATE_S, from_dock_m, heal, newest, sent, step, unanswered
from tests.builders.waiting import Waiting


@pytest.fixture
def asked() -> Iterator[tuple[Waiting, TestClient]]:
    """A question in a zone with a safe place, and somebody who reads about it."""
    with unanswered() as made:
        settings = ConsoleSettings(port=8000, robots=("vbot-1",), owner_token=SecretStr(OWNER))
        app = create_app(
            made.harness.runtime,
            settings,
            SignalBroker(),
            Scenes(made.harness.runtime),
            accounts=quick_accounts(settings),
            answer=made.harness.supervisor.answer,
        )
        yield made, Stand(made.harness, app).operator()


def report(made: Waiting, client: TestClient) -> object:
    return client.get(f"/missions/{made.mission_id}/report.json").json()["no_answer"]


def test_what_was_meant_done_and_measured_without_an_answer_stands_apart(asked: tuple[Waiting, TestClient]) -> None:
    made, client = asked
    assert report(made, client) is None, "somebody may still answer"
    made.pass_s(LATE_S)
    step(made)
    meant = {"action": "retreat", "safe_place": "Anchor A", "otherwise": "lie_down"}
    under_way = report(made, client)
    assert isinstance(under_way, dict)
    assert (under_way["intended"], under_way["done"], under_way["measured"]) == (meant, None, None)
    assert (under_way["retreat"]["place"], under_way["retreat"]["outcome"]) == ("Anchor A", None)
    made.run()
    over, ended = report(made, client), newest(made).ended
    assert isinstance(over, dict)
    assert ended is not None
    assert (over["handoff_id"], over["intended"]) == (made.handoff_id, meant)
    assert (over["done"]["action"], over["done"]["shown"]) == ("retreat", True)
    assert over["measured"] == ended.measured == over["retreat"]["measured"]
    assert abs(over["measured"]["distance_m"] - from_dock_m(made)) < 0.1, "measured, and near the truth"
    assert (over["retreat"]["outcome"], over["retreat"]["declared"]) == ("reached", "succeeded")
    assert over["retreat"]["authorised_by"] == "surveyor of site-1"
    assert [over["retreat"]["request_id"]] == [start.request_id for start in sent(made)]
    page = client.get(f"/missions/{made.mission_id}/report").text
    assert over["done"]["reason"] in page


def test_each_mission_is_told_of_its_own_retreat(asked: tuple[Waiting, TestClient]) -> None:
    made, client = asked
    requests = []
    for _ in range(2):
        made.pass_s(LATE_S)
        made.run()
        told = report(made, client)
        assert isinstance(told, dict)
        requests.append((made.mission_id, told["retreat"]["request_id"]))
        made.asked(fault=ASKS)
        heal(made)
    assert len({request for _, request in requests}) == 2
    for mission_id, request in requests:
        told = client.get(f"/missions/{mission_id}/report.json").json()["no_answer"]
        assert told["retreat"]["request_id"] == request


def test_a_mission_whose_questions_were_answered_or_never_asked_has_none() -> None:
    with console_stand() as stand:
        mission, operator = stand.run("circuit"), stand.operator()
        assert operator.get(f"/missions/{mission.mission_id}/report.json").json()["no_answer"] is None
