"""Promises that hold over all pages at once: nobody is offered what refuses them, a stop is everywhere, and by hand."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser

import pytest
from fastapi.testclient import TestClient

from app.permissions import ROLES
from harness.contracts.ids import HandoffId, MissionId
from harness.projections.handoffs import Handoff
from tests.builders.consoles import Stand, console_stand
from tests.builders.fleets import ONE, TWO, fleet_stand, moving, run_together, started
from tests.builders.people import everybody

DEEP = re.compile(r"[?#]|/evidence/.|/events/|/audit/|/scene|/static/|\.(pdf|json|zip|jpg|viser)$|/account/sign")
ASKS = "interrupted:persistent"
FIELDS = ("claim", "key", "cycle")


class Offered(HTMLParser):
    """What a page offers: links, forms that ask, forms that act, and the buttons of its header."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.acts: set[str] = set()
        self.asks: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag == "a" and given.get("href", "").startswith("/"):
            self.links.add(given["href"])
        if tag == "form" and given.get("action"):
            (self.acts if given.get("method") == "post" else self.asks).add(given["action"])


@pytest.fixture(scope="module")
def house() -> Iterator[tuple[Stand, dict[str, TestClient], MissionId, MissionId]]:
    """One robot under way, the other waiting for a person, and somebody of every role."""
    with fleet_stand() as stand:
        asking = started(stand.harness, TWO, faults=ASKS)
        run_together(stand.harness, asking)
        driving = started(stand.harness, ONE)
        run_together(stand.harness, driving, until=lambda: moving(stand.harness, driving))
        assert stand.harness.runtime.mission(asking).status == "awaiting_human"
        yield stand, everybody(stand), driving, asking


def walked(client: TestClient, *, pages: int = 90) -> dict[str, Offered]:
    """Every page that somebody reaches by links and by forms that only ask, without the depths of the evidence."""
    found: dict[str, Offered] = {}
    due = ["/"]
    while due and len(found) < pages:
        path = due.pop(0)
        if path in found or DEEP.search(path):
            continue
        answer = client.get(path)
        if answer.status_code == 303 or not answer.headers["content-type"].startswith("text/html"):
            continue
        assert answer.status_code == 200, (path, answer.status_code)
        found[path] = Offered(answer.text)
        due += sorted(found[path].links | found[path].asks)
    return found


@pytest.mark.parametrize("role", ROLES)
def test_no_page_offers_an_act_that_it_refuses_to_whoever_reads_it(
    house: tuple[Stand, dict[str, TestClient], MissionId, MissionId], role: str
) -> None:
    client = house[1][role]
    pages = walked(client)
    assert len(pages) > 20
    acts = {act: path for path, page in pages.items() for act in page.acts if "/sign-out" not in act}
    refused = {act: path for act, path in sorted(acts.items()) if client.post(act, data={}).status_code == 403}
    assert refused == {}
    assert ("/missions" in acts) == (role == "operator")


def test_every_page_has_a_stop_for_each_robot_that_names_it_and_its_mission(
    house: tuple[Stand, dict[str, TestClient], MissionId, MissionId],
) -> None:
    _, people, driving, asking = house
    for path, page in walked(people["operator"]).items():
        stops = {f"/missions/{driving}/stop", f"/missions/{asking}/stop", "/robots/stop"}
        assert stops <= page.asks, path
    text = people["operator"].get("/places").text
    for robot_id, mission_id in ((ONE, driving), (TWO, asking)):
        assert f"Software stop of {robot_id}, mission {mission_id}" in text
    for path in ("/", f"/missions/{driving}/stop", "/robots/stop"):
        assert not any(act.endswith("/stop") for act in Offered(people["viewer"].get(path).text).acts)
    assert "Your role does not let you stop" in people["viewer"].get(f"/missions/{driving}/stop").text


def words_of(client: TestClient, handoff_id: HandoffId) -> dict[str, str]:
    """What binds a form of the question's page to it."""
    text = client.get(f"/handoffs/{handoff_id}").text
    return {name: re.findall(rf'name="{name}" value="([^"]*)"', text)[0] for name in FIELDS}


def handoff(stand: Stand, handoff_id: HandoffId) -> Handoff:
    return stand.harness.runtime.handoff(handoff_id)


def test_a_person_takes_over_drives_and_hands_back_and_the_harness_looks_for_itself() -> None:
    with console_stand() as stand:
        mission, handoff_id = stand.handed_off()
        operator, address = stand.operator(), f"/handoffs/{handoff_id}"
        token = words_of(operator, handoff_id)["claim"] or words_of(operator, handoff_id)["key"]
        assert operator.post(f"{address}/claim", data={"claim": token}).status_code == 303
        by_hand = {**words_of(operator, handoff_id), "device": "tablet", "reason": "round the pallet"}
        assert operator.post(f"{address}/take-over", data=by_hand).status_code == 303
        page = operator.get(address).text
        assert "You drive vbot-1 from tablet" in page and 'value="round the pallet"' in page
        wheel = {"device": "tablet", "reason": "round the pallet"}
        assert operator.post("/robots/vbot-1/drive", data=wheel).status_code == 303
        pad = operator.get("/robots/vbot-1/drive").text
        assert f'action="/handoffs/{handoff_id}/claim" data-keep=' in pad
        assert "Its deadline is paused" in pad
        session = stand.app.state.console.control().wheels["vbot-1"].session
        before = len(stand.harness.starts(mission.mission_id))
        for _ in range(4):
            operator.post("/robots/vbot-1/drive/turn", json={"session": session, "v_mps": 0.3})
            stand.harness.clock.wait_until(stand.harness.clock.now().mission_s + 0.4)
        stand.harness.clock.wait_until(stand.harness.clock.now().mission_s + 4.0)
        early = operator.post(f"{address}/hand-back", data={**words_of(operator, handoff_id), "reason": "drove it"})
        assert early.status_code == 409 and "Return the wheel first" in early.text
        assert handoff(stand, handoff_id).status == "taken_over"
        back = operator.post("/robots/vbot-1/drive/return")
        assert (back.status_code, back.headers["location"]) == (303, address)
        done = operator.post(f"{address}/hand-back", data={**words_of(operator, handoff_id), "reason": "drove it"})
        assert done.status_code == 303
        stand.harness.supervisor.run(mission.mission_id)
        looks = stand.harness.starts(mission.mission_id)[before:]
        answer = handoff(stand, handoff_id).answer
        assert answer is not None and answer.decision == "handed_back"
        assert looks and not looks[0].moves
        assert "handed back" in operator.get(address).text


def test_a_robot_nobody_took_over_goes_back_to_its_own_page() -> None:
    with console_stand() as stand:
        operator = stand.operator()
        wheel = {"device": "tablet", "reason": "out of the way"}
        assert operator.post("/robots/vbot-1/drive", data=wheel).status_code == 303
        again = operator.post("/robots/vbot-1/drive", data=wheel)
        assert (again.status_code, again.headers["location"]) == (303, "/robots/vbot-1/drive")
        assert "data-keep" not in operator.get("/robots/vbot-1/drive").text
        assert operator.post("/robots/vbot-1/drive/return").headers["location"] == "/robots/vbot-1"
