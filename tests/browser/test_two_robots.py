"""Two real robots in a browser: driving by hand stops when let go, and a stop of everything reaches both."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.browser.test_watch_mission import Console

SETTLED_MS = 8000


@pytest.fixture
def house(tmp_path: Path) -> Iterator[Console]:
    running = Console(tmp_path / "data", "--speed", "2", "--robots", "vbot-1,vbot-2")
    yield running
    running.stop()


def take_the_wheel(page: Page, address: str) -> None:
    page.goto(f"{address}/robots/vbot-1/drive")
    page.get_by_label("Device").fill("tablet")
    page.get_by_label("Why").fill("out of the way")
    page.get_by_role("button", name="Take the wheel").click()
    expect(page.get_by_role("heading", name="Hold to run, let go to stop")).to_be_visible()
    expect(page.locator("body")).to_have_attribute("data-link", "live")


def test_letting_go_leaving_the_page_and_a_lost_link_each_stop_the_robot(
    house: Console, open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    console_watch.expect("ERR_INTERNET_DISCONNECTED|ERR_NETWORK|net::|Failed to fetch")
    page = open_page(house.link)
    take_the_wheel(page, house.address)
    word = page.locator(".pad-word")
    page.get_by_role("button", name="Ahead").hover()
    page.mouse.down()
    expect(word).to_contain_text("driving, 0.", timeout=SETTLED_MS)
    take_picture(page, "robots-drive", whole=False)
    page.mouse.up()
    expect(word).to_have_text("standing", timeout=SETTLED_MS)
    page.keyboard.down("ArrowLeft")
    expect(word).to_contain_text("driving", timeout=SETTLED_MS)
    page.locator("body").dispatch_event("blur")
    page.keyboard.up("ArrowLeft")
    expect(word).to_have_text("standing", timeout=SETTLED_MS)
    page.keyboard.down("ArrowUp")
    expect(word).to_contain_text("driving", timeout=SETTLED_MS)
    page.context.set_offline(True)
    expect(word).to_contain_text("The link is lost", timeout=SETTLED_MS)
    page.keyboard.up("ArrowUp")
    page.context.set_offline(False)
    page.get_by_role("button", name="Return the wheel").click()
    expect(page.locator("#robot")).to_contain_text("standing", timeout=SETTLED_MS)
    expect(page.locator("#robot")).to_contain_text("In control: nobody")


def test_on_a_phone_the_stop_of_everything_is_in_reach_and_the_robots_are_shown(
    house: Console, open_page: OpenPage, take_picture: TakePicture
) -> None:
    page = open_page(house.link, width=390, height=844)
    page.wait_for_url(re.compile(r"/$"))
    page.goto(f"{house.address}/robots")
    expect(page.locator("#robots img").first).to_be_visible()
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    expect(page.get_by_role("button", name="Stop all")).to_be_in_viewport()
    take_picture(page, "robots-phone")
    page.get_by_role("button", name="Stop all").click()
    expect(page.get_by_text("No robot runs a mission")).to_be_visible()
