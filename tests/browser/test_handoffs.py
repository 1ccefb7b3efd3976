"""A person decides at a handoff in a browser: sees, holds, follows; in two tabs; on a phone; and axe finds nothing.

The console runs in this process over a mission that waits in virtual time; the robot's loop is stepped by the tests.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from threading import Thread
from typing import Literal

import pytest
import uvicorn
from fastapi import FastAPI
from playwright.sync_api import Page, expect
from pydantic import SecretStr

from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.main import bind, create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.browser.test_accessible import CONTRAST, LEVELS, broken
from tests.builders.accounts import quick_accounts
from tests.builders.serving import hold
from tests.builders.timeouts import TIMEOUT_S
from tests.builders.waiting import BOB, Waiting, waiting

SCHEMES: tuple[tuple[Literal["light", "dark"], dict[str, object]], ...] = (("light", LEVELS), ("dark", CONTRAST))


@dataclass(frozen=True)
class Served:
    """A console that answers, and the mission that waits behind it."""

    app: FastAPI
    address: str
    asked: Waiting

    @property
    def question(self) -> str:
        return f"{self.address}/handoffs/{self.asked.handoff_id}"

    def enter(self, page: Page) -> Page:
        """Sign in and open the question."""
        page.goto(self.address + self.app.state.sessions.invite())
        page.wait_for_url(re.compile(r"/$"))
        page.goto(self.question)
        return page


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
            starts=made.harness.starts,
            fleet=fleet,
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield Served(app, f"http://127.0.0.1:{settings.port}", asked)
        broker.close()
        server.should_exit = True
        thread.join(timeout=TIMEOUT_S)
        listener.close()


def test_a_person_sees_holds_and_follows_and_done_is_never_said_at_approved(
    served: Served, open_page: OpenPage, take_picture: TakePicture
) -> None:
    page = served.enter(open_page())
    expect(page.locator(".callout").first).to_contain_text("If nobody answers")
    expect(page.locator(".camera img").first).to_be_visible()
    expect(page.locator(".robot-mark")).to_have_count(2)
    take_picture(page, "handoff-light")
    served.asked.turn_to_now()
    with page.expect_navigation():
        page.locator("#look").click()
    page.locator("#claim").click()
    expect(page.locator(".holding")).to_contain_text("You have claimed it")
    page.get_by_role("button", name="seen on camera").click()
    button = page.locator("#approve")
    button.scroll_into_view_if_needed()
    button.hover()
    page.mouse.down()
    page.wait_for_url(served.question)
    expect(page.locator(".steps")).to_contain_text("Decision applied at event")
    page.mouse.up()
    expect(page.locator(".steps")).to_contain_text("has not confirmed an effect yet")
    assert "done" not in page.locator(".steps").inner_text().lower().split()
    served.asked.run()
    expect(page.locator(".steps")).to_contain_text(re.compile("failed:|confirmed:"))


def test_what_is_typed_right_after_claiming_is_kept_and_counts(served: Served, open_page: OpenPage) -> None:
    page = served.enter(open_page())
    page.locator("#reason").fill("a pallet ")
    page.locator("#claim").click()
    page.locator("#reason").press_sequentially("stands in the way", delay=20)
    expect(page.locator(".holding")).to_contain_text("You have claimed it")
    expect(page.locator("#reason")).to_have_value("a pallet stands in the way")
    expect(page.locator("#reason")).to_be_focused()
    page.locator("#on-my-way").click()
    expect(page.locator(".holding")).to_contain_text("operator is on the way")
    expect(page.locator("#reason")).to_have_value("a pallet stands in the way")
    expect(page.locator("[data-changed]")).to_be_hidden()
    with page.expect_navigation():
        page.locator("#look").click()
    expect(page.locator("#reason")).to_have_value("a pallet stands in the way")
    hold(page, "#reject")
    expect(page.locator(".steps")).to_contain_text("a pallet stands in the way")


def test_why_an_answer_did_not_count_stays_while_the_robot_goes_on_telling(
    served: Served, open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    console_watch.expect("409")
    page = served.enter(open_page())
    served.asked.claim(BOB, "t-bob")
    expect(page.locator(".holding")).to_contain_text("bob has claimed it")
    with page.expect_navigation():
        page.locator("#look").click()
    expect(page.locator("#errors")).to_contain_text("bob has claimed it until")
    expect(page.locator("body")).to_have_attribute("data-link", "live")
    page.locator("h1").evaluate("title => { title.dataset.old = 'yes'; }")
    served.app.state.console.broker.changed(f"live/{served.asked.mission_id}")
    expect(page.locator("h1")).not_to_have_attribute("data-old", "yes")
    expect(page.locator("#errors")).to_contain_text("bob has claimed it until")


def test_the_second_of_two_tabs_is_told_who_decided_what_and_when(
    served: Served, open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    console_watch.expect("409")
    first, second = served.enter(open_page()), served.enter(open_page(scripts=False))
    first.get_by_role("button", name="not safe").click()
    hold(first, "#reject")
    expect(first.locator(".steps")).to_contain_text("not safe")
    second.locator("#reason").fill("path is clear now")
    second.locator("#reject").click()
    told = second.locator("#errors")
    expect(told).to_contain_text("operator rejected it before you, at")
    expect(told).to_contain_text("not safe")


def test_on_a_phone_the_buttons_come_before_the_history_and_axe_finds_nothing(
    served: Served, open_page: OpenPage, take_picture: TakePicture
) -> None:
    page = served.enter(open_page(width=390, height=844))
    places = {
        name: page.locator(selector).first.bounding_box()
        for name, selector in {
            "question": ".callout",
            "camera": ".camera",
            "action": ".decide",
            "buttons": "#reject",
            "history": ".why",
        }.items()
    }
    tops = [box["y"] for box in places.values() if box is not None]
    assert len(tops) == 5 and [tops[0], tops[1], tops[2], tops[4]] == sorted([tops[0], tops[1], tops[2], tops[4]])
    for selector in (".callout", ".asked .camera img", ".asked .sitemap", "#approve", "#reject"):
        expect(page.locator(selector).first).to_be_in_viewport()
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    take_picture(page, "handoff-phone")
    for scheme, rules in SCHEMES:
        page.emulate_media(color_scheme=scheme)
        assert broken(page, rules) == []
    expect(page.locator(".decide .act")).to_be_in_viewport()
    assert page.evaluate("document.fonts.check('14px \"Language Names\"', '简体中文')"), "the switch is legible"
    page.locator("#reason").fill("looked at it twice")
    page.evaluate("document.querySelector('#approve').dataset.freshUntil = '1'")
    expect(page.locator("#approve")).to_be_hidden()
    again = page.locator("#look-now")
    expect(again).to_be_in_viewport()
    with page.expect_navigation():
        again.click()
    expect(page.locator("#approve")).to_be_visible()
    expect(page.locator("#reason")).to_have_value("looked at it twice")
