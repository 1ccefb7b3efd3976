"""Somebody who was never told how: finds why a robot waits, takes it over, drives, hands back, and is asked again.

The console runs in this process over a mission that waits in virtual time; the robot's loop is stepped by the test.
"""

import re
from collections.abc import Iterator
from threading import Thread

import pytest
import uvicorn
from playwright.sync_api import Page, expect
from pydantic import SecretStr

from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.main import bind, create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from tests.browser.conftest import OpenPage, TakePicture
from tests.browser.test_handoffs import Served
from tests.builders.accounts import quick_accounts
from tests.builders.timeouts import TIMEOUT_S, wait_until
from tests.builders.waiting import Waiting, waiting

LITTLE_S = 40.0
"""A page that opens with less of its claim left renews it at once."""


@pytest.fixture
def served() -> Iterator[Served]:
    broker = SignalBroker()
    with waiting(signals=broker) as made:
        asked = made.asked()
        listener = bind(0)
        settings = ConsoleSettings(port=listener.getsockname()[1], robots=("vbot-1",), owner_token=SecretStr("t"))
        fleet = Fleet(made.harness.robots, made.harness.cameras, lambda: asked.wall_s)
        app = create_app(
            made.runtime,
            settings,
            broker,
            Scenes(made.runtime),
            accounts=quick_accounts(settings),
            answer=made.supervisor.answer,
            fleet=fleet,
            teleoperation=made.harness.teleoperation,
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield Served(app, f"http://127.0.0.1:{settings.port}", asked)
        broker.close()
        server.should_exit = True
        thread.join(timeout=TIMEOUT_S)
        listener.close()


def taken_over(page: Page) -> None:
    """From the first page to the wheel, by what is written on the buttons."""
    page.get_by_role("link", name="and asks you").click()
    page.get_by_text("Drive it yourself, pause the mission, or keep the robot").click()
    page.get_by_label("Device you drive from").fill("keyboard at desk 2")
    page.locator("form", has=page.locator("#take-over")).get_by_label("Reason").fill("round the pallet")
    page.get_by_role("button", name="Take over").click()
    expect(page.locator(".callout").first).to_contain_text("You drive vbot-1 from keyboard at desk 2")


def test_a_newcomer_takes_a_robot_over_keeps_it_while_driving_and_hands_it_back(
    served: Served, open_page: OpenPage, take_picture: TakePicture
) -> None:
    asked = served.asked
    page = open_page(served.address + served.app.state.sessions.invite())
    opened_s = asked.wall_s
    asked.turn_to(opened_s - LITTLE_S / 2)
    taken_over(page)
    claim = asked.handoff.claim
    assert claim is not None
    asked.turn_to(opened_s)
    expect(page.get_by_role("button", name="Take control")).to_be_in_viewport()
    page.get_by_role("button", name="Take control").click()
    expect(page.get_by_role("heading", name="Hold to run, let go to stop")).to_be_visible()
    expect(page.locator(".callout").first).to_contain_text("Its deadline is paused")
    expect(page.get_by_role("button", name="Release control and go to the handoff")).to_be_in_viewport()
    camera, floor = (page.locator(f".live-view {one}").bounding_box() for one in (".camera", ".robot-map"))
    assert camera is not None and floor is not None
    assert camera["x"] + camera["width"] <= floor["x"] and abs(camera["y"] - floor["y"]) < camera["height"] / 2
    take_picture(page, "newcomer-pad")
    page.get_by_role("button", name="Ahead").focus()
    page.keyboard.down("ArrowUp")
    clock, word = asked.harness.clock, page.locator(".pad-word")

    def driving() -> bool:
        clock.wait_until(clock.now().mission_s + 0.2)
        if "The link is lost" in word.inner_text():
            page.keyboard.up("ArrowUp")
            page.keyboard.down("ArrowUp")
        return "driving" in word.inner_text()

    wait_until(page, driving, "a robot that drives")
    page.keyboard.up("ArrowUp")
    wait_until(page, lambda: _until_s(asked) > claim.until_at_s, "a claim that is kept while its holder drives")
    page.get_by_role("button", name="Release control and go to the handoff").click()
    page.wait_for_url(served.question)
    page.get_by_label("What you did").fill("drove it past the pallet")
    with page.expect_navigation():
        page.get_by_role("button", name="Hand back").click()
    expect(page.locator(".steps")).to_contain_text("drove it past the pallet")
    asked.run()
    expect(page.locator(".steps")).to_contain_text(re.compile("confirmed:|failed:"))
    expect(page.locator(".steps")).to_contain_text("looking")
    if asked.mission.status == "awaiting_human":
        page.get_by_role("link", name="asks again").click()
        expect(page.locator("h1")).to_contain_text("asks you")
    take_picture(page, "newcomer-handed-back")


def _until_s(asked: Waiting) -> float:
    """How long the question's claim holds."""
    claim = asked.handoff.claim
    return claim.until_at_s if claim is not None else 0.0
