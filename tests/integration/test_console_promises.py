"""Promises that hold over all pages at once: nobody is offered what refuses them, a stop is everywhere, and by hand."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from pydantic import SecretStr

from app.acts import releases
from app.auth.permissions import ROLES
from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.i18n.reasons.rendering import sentence
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.contracts.ids import HandoffId, MissionId
from harness.projections.handoffs import Handoff
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.builders.fleets import ONE, TWO, fleet_stand, moving, run_together, started
from tests.builders.people import everybody
from tests.builders.waiting import Waiting, waiting

DEEP = re.compile(r"[?#]|/evidence/.|/events/|/audit/|/scene|/static/|\.(pdf|json|zip|jpg|viser)$|/account/sign")
ASKS = "interrupted:persistent"
FIELDS = ("claim", "key", "cycle")


def console_over(made: Waiting) -> FastAPI:
    """A console over a mission that waits by a wall clock in hand."""
    settings = ConsoleSettings(port=8000, robots=("vbot-1",), owner_token=SecretStr(OWNER))
    harness = made.harness
    fleet = Fleet(harness.robots, harness.cameras, lambda: made.wall_s)
    return create_app(
        harness.runtime,
        settings,
        SignalBroker(),
        Scenes(harness.runtime),
        accounts=quick_accounts(settings),
        answer=harness.supervisor.answer,
        fleet=fleet,
    )


class Offered(HTMLParser):
    """What a page offers: links, forms that ask, forms that act, and the buttons of its header."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.acts: set[str] = set()
        self.asks: set[str] = set()
        self._posts = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag == "a" and given.get("href", "").startswith("/"):
            self.links.add(given["href"])
        if tag == "form":
            self._posts = given.get("action", "") if given.get("method") == "post" else ""
            self.asks |= {given["action"]} if given.get("action") and not self._posts else set()
        if tag == "button" and "disabled" not in given and self._posts:
            self.acts.add(self._posts)


@pytest.fixture(scope="module")
def site() -> Iterator[tuple[Stand, dict[str, TestClient], MissionId, MissionId]]:
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
    site: tuple[Stand, dict[str, TestClient], MissionId, MissionId], role: str
) -> None:
    client = site[1][role]
    pages = walked(client)
    assert len(pages) > 20
    acts = {act: path for path, page in pages.items() for act in page.acts if "/sign-out" not in act}
    refused = {act: path for act, path in sorted(acts.items()) if client.post(act, data={}).status_code == 403}
    assert refused == {}
    assert ("/missions" in acts) == (role == "operator")


def test_every_page_has_a_stop_for_each_robot_that_names_it_and_its_mission(
    site: tuple[Stand, dict[str, TestClient], MissionId, MissionId],
) -> None:
    _, people, driving, asking = site
    for path, page in walked(people["operator"]).items():
        stops = {f"/robots/{ONE}/stop", f"/robots/{TWO}/stop", "/robots/stop"}
        assert stops <= page.acts, path
    text = people["operator"].get("/places").text
    for robot_id, mission_id in ((ONE, driving), (TWO, asking)):
        assert f"{robot_id} runs mission {mission_id}." in text
    for path in ("/", f"/missions/{driving}/stop", "/robots/stop"):
        page = people["viewer"].get(path).text
        assert len(re.findall('class="stop( quiet)?"', page)) == page.count("Your role does not let you stop it.")
    assert "Your role does not let you stop" in sentence(people["viewer"].get(f"/missions/{driving}/stop").text)


def words_of(client: TestClient, handoff_id: HandoffId) -> dict[str, str]:
    """What binds a form of the question's page to it."""
    text = client.get(f"/handoffs/{handoff_id}").text
    return {name: re.findall(rf'name="{name}"\s+value="([^"]*)"', text)[0] for name in FIELDS}


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
        teleoperation = {"device": "tablet", "reason": "round the pallet"}
        assert operator.post("/robots/vbot-1/drive", data=teleoperation).status_code == 303
        pad = operator.get("/robots/vbot-1/drive").text
        assert re.search(rf'action="/handoffs/{handoff_id}/claim"\s+data-keep=', pad)
        assert "Its deadline is paused" in pad
        session = stand.app.state.console.control().wheels["vbot-1"].session
        before = len(stand.harness.starts(mission.mission_id))
        for _ in range(4):
            operator.post("/robots/vbot-1/drive/turn", json={"session": session, "v_mps": 0.3})
            stand.harness.clock.wait_until(stand.harness.clock.now().mission_s + 0.4)
        stand.harness.clock.wait_until(stand.harness.clock.now().mission_s + 4.0)
        early = operator.post(f"{address}/hand-back", data={**words_of(operator, handoff_id), "reason": "drove it"})
        assert early.status_code == 409 and "Release control first" in early.text
        said = {"claim": words_of(operator, handoff_id)["claim"], "key": "k-api", "reason": "drove it"}
        program = operator.post(f"/api/v1{address}/hand-back", json=said)
        assert (program.status_code, program.json()["code"]) == (409, "wheel_held")
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
        teleoperation = {"device": "tablet", "reason": "out of the way"}
        assert operator.post("/robots/vbot-1/drive", data=teleoperation).status_code == 303
        again = operator.post("/robots/vbot-1/drive", data=teleoperation)
        assert (again.status_code, again.headers["location"]) == (303, "/robots/vbot-1/drive")
        assert "data-keep" not in sentence(operator.get("/robots/vbot-1/drive").text)
        assert operator.post("/robots/vbot-1/drive/return").headers["location"] == "/robots/vbot-1"


def test_how_the_robot_is_stands_beside_stop_and_approve() -> None:
    with fleet_stand() as stand:
        asking = started(stand.harness, TWO, faults=ASKS)
        run_together(stand.harness, asking)
        operator = stand.operator()
        handoff_id = stand.harness.runtime.mission(asking).handoff_id
        for path in (f"/missions/{asking}/stop", f"/handoffs/{handoff_id}", f"/robots/{TWO}"):
            text = operator.get(path).text
            strip = text.partition('robot-word" data-link=')[2].partition("</p>")[0]
            for word in (TWO, "battery", "localised", "hardware stop", "link", "standing"):
                assert word in strip, (path, word)


def test_what_is_said_after_a_mission_ended_does_not_make_it_longer() -> None:
    with console_stand() as stand:
        mission = stand.run("circuit")
        operator, address = stand.operator(), f"/missions/{mission.mission_id}"
        took = re.compile(r"([^<>,]*) of mission time")
        before = took.findall(operator.get(f"{address}/report").text)
        stand.harness.clock.wait_until(stand.harness.clock.now().mission_s + 600.0)
        page = operator.get(f"{address}/report").text
        act = next(one for one in Offered(page).acts if one.endswith("/dispute"))
        assert operator.post(act, data={"reason": "another room", "from": "report"}).status_code == 303
        assert stand.harness.runtime.mission(mission.mission_id).false_completions
        assert before and took.findall(operator.get(f"{address}/report").text) == before


def test_a_question_that_nobody_answered_is_never_shown_as_a_persons_decision() -> None:
    with waiting() as made:
        asked = made.asked()
        stand = Stand(made.harness, console_over(made))
        operator = stand.operator()
        limit_s = asked.handoff.opened.deadline_at_s if asked.handoff.opened else 0.0
        asked.turn_to(limit_s + 1.0)
        asked.run()
        page = operator.get(f"/handoffs/{asked.handoff_id}").text
        assert asked.handoff.answer is None and asked.mission.status == "safe_stopped"
        assert "<b>expired</b>" in page and "nobody answered" in page
        assert "Decision applied" not in page
        assert asked.handoff_id in operator.get("/handoffs?status=expired").text


FACTS = "/missions/{mission_id}/facts"
TWINS = {
    "/account/people": "/accounts",
    "/account/people/{name}": "/accounts/{name}",
    "/account/tokens": "/tokens",
    "/account/tokens/{token_id}/revoke": "/tokens/{token_id}",
    f"{FACTS}/{{packet_id}}/{{condition_id}}/dispute": f"{FACTS}/{{condition_id}}/dispute",
    "/places/new": "/places/{place_id}",
    "/places/{place_id}/edit": "/places/{place_id}",
    "/routes/new": "/routes/{name}",
    "/routes/{name}/edit": "/routes/{name}",
    "/own-robots/new": "/own-robots/{name}",
    "/own-robots/{name}/edit": "/own-robots/{name}",
    "/own-missions/new": "/own-missions/{name}",
    "/own-missions/{name}/edit": "/own-missions/{name}",
    "/queue/{mission_id}/withdraw": "/missions/{mission_id}/withdraw",
    "/robots/autonomy": "/control/autonomy",
    "/robots/{robot_id}/autonomy": "/missions/{mission_id}/autonomy",
    "/robots/{robot_id}/drive": "/robots/{robot_id}/teleoperation",
    "/robots/{robot_id}/drive/return": "/robots/{robot_id}/teleoperation/return",
    "/robots/{robot_id}/drive/turn": "/robots/{robot_id}/teleoperation/turn",
    "/robots/{robot_id}/release": "/leases/{resource}/free",
    "/handoffs/{handoff_id}/pause": "/missions/{mission_id}/pause",
    "/handoffs/{handoff_id}/resume": "/missions/{mission_id}/resume",
    "/robots/{robot_id}/pause": "/missions/{mission_id}/pause",
    "/robots/{robot_id}/resume": "/missions/{mission_id}/resume",
    "/robots/{robot_id}/stand": "/robots/{robot_id}/posture",
    "/candidates/knobs": "/candidates",
    "/recordings": "/uploads",
    **{f"/recordings/{{upload_id}}/{turn}": f"/uploads/{{upload_id}}/{turn}" for turn in ("replay", "cloud")},
    "/recordings/{upload_id}/map": "/uploads/{upload_id}/map",
    "/recordings/{upload_id}/remove": "/uploads/{upload_id}",
    "/recordings/replays/{job_id}/cancel": "/replays/{job_id}",
    "/queue/goals/{proposal_id}/dismiss": "/goal-proposals/{proposal_id}/dismiss",
}
"""Where the API says it otherwise than the page does."""
OWN = {
    "/account/password", "/account/sign-in", "/account/sign-out", "/account/sign-out-everywhere",
    "/missions/{mission_id}/scene/{view}/instant", "/account/terminal", "/audit/anchors",
}  # fmt: skip
"""A person's own browser: nothing changes for anybody else."""
SIMULATED = {"/robots/{robot_id}/simulation/clear-way"}
"""What a person does in the simulated world, where a program would have to go there."""


def test_every_act_of_a_page_is_described_for_programs_too() -> None:
    with console_stand() as stand:
        described = stand.operator().get("/api/v1/openapi.json").json()["paths"]
        pages = {path for method, path in routes_of(stand.app) if method == "POST" and not path.startswith("/api/")}
        assert pages > OWN and TWINS.keys() <= pages
        each = {path.replace("{verb}", verb) for path in pages - OWN - SIMULATED for verb in releases.ACTS}
        lacking = {path for path in each if f"/api/v1{TWINS.get(path, path)}" not in described}
        assert lacking == set()


def routes_of(app: FastAPI) -> set[tuple[str, str]]:
    """(method, path) of every route."""
    found: set[tuple[str, str]] = set()
    for route in app.routes:
        for inner in getattr(getattr(route, "original_router", None), "routes", [route]):
            path = re.sub(r":\w+\}", "}", getattr(inner, "path", ""))
            found |= {(method, path) for method in getattr(inner, "methods", None) or set()}
    return found


def test_everybody_sees_who_else_is_here_and_who_looks_at_the_same_question() -> None:
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        operator, presence = stand.operator(), stand.app.state.console.presence
        assert "nobody else is looking" in sentence(operator.get(f"/handoffs/{handoff_id}").text)
        with presence.here("ben", (f"handoff/{handoff_id}",)):
            assert "also here: ben" in operator.get("/places").text
            assert "also looking: <b>ben</b>" in sentence(operator.get(f"/handoffs/{handoff_id}").text)
        assert "also here" not in operator.get("/places").text
