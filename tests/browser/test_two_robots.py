"""Two real robots in a browser: driving by hand stops when let go, and a stop of everything reaches both."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.browser.test_watch_mission import Console

TRIES = 10


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Console]:
    running = Console(tmp_path / "data", "--speed", "2", "--robots", "vbot-1,vbot-2")
    yield running
    running.stop()


def take_control(page: Page, address: str) -> None:
    page.goto(f"{address}/robots/vbot-1/drive")
    page.get_by_label("Device").fill("tablet")
    page.get_by_label("Why", exact=True).fill("out of the way")
    page.get_by_role("button", name="Take control").click()
    expect(page.get_by_role("heading", name="Hold to run, let go to stop")).to_be_visible()
    expect(page.locator("body")).to_have_attribute("data-link", "live")


def drives(page: Page, press: Callable[[], None], let_go: Callable[[], None]) -> None:
    """Press until it drives: where a busy machine answers an order too late, the page lets go by itself."""
    word = page.locator(".pad-word")
    for _ in range(TRIES):
        word.evaluate("said => { said.textContent = ''; }")
        press()
        expect(word).to_have_text(re.compile("^driving|The link is lost|^Not live"))
        if word.inner_text().startswith("driving"):
            return
        let_go()
        expect(page.locator("body")).to_have_attribute("data-link", "live")
    raise AssertionError(f"{TRIES} times the robot did not drive: {word.inner_text()}")


def test_letting_go_leaving_the_page_and_a_lost_link_each_stop_the_robot(
    console: Console, open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    console_watch.expect("ERR_INTERNET_DISCONNECTED|ERR_NETWORK|net::|Failed to fetch")
    page = open_page(console.link)
    take_control(page, console.address)
    word = page.locator(".pad-word")
    page.get_by_role("button", name="Ahead").hover()
    drives(page, page.mouse.down, page.mouse.up)
    expect(word).to_contain_text("driving, 0.")
    take_picture(page, "robots-drive", whole=False)
    page.mouse.up()
    expect(word).to_have_text("standing")
    drives(page, lambda: page.keyboard.down("ArrowLeft"), lambda: page.keyboard.up("ArrowLeft"))
    page.locator("body").dispatch_event("blur")
    page.keyboard.up("ArrowLeft")
    expect(word).to_have_text("standing")
    drives(page, lambda: page.keyboard.down("ArrowUp"), lambda: page.keyboard.up("ArrowUp"))
    page.context.set_offline(True)
    expect(word).to_contain_text("The link is lost")
    page.keyboard.up("ArrowUp")
    page.context.set_offline(False)
    page.get_by_role("button", name="Release control").click()
    expect(page.locator("#robot")).to_contain_text("standing")
    expect(page.locator("#robot")).to_contain_text("In control: nobody")


@pytest.mark.parametrize("address", ["/", "/fleet"])
def test_names_of_robots_that_stand_at_one_place_do_not_lie_over_each_other(
    console: Console, open_page: OpenPage, address: str
) -> None:
    page = open_page(console.link)
    page.wait_for_url(re.compile(r"/$"))
    page.goto(f"{console.address}{address}")
    names = [page.locator(".robot-mark text", has_text=one) for one in ("vbot-1", "vbot-2")]
    for name in names:
        expect(name).to_be_visible()
    upper, lower = sorted((name.bounding_box() or {} for name in names), key=lambda box: box["y"])
    assert upper["y"] + upper["height"] <= lower["y"] + 1


def test_on_a_phone_the_stop_of_everything_is_in_reach_and_the_robots_are_shown(
    console: Console, open_page: OpenPage, take_picture: TakePicture
) -> None:
    page = open_page(console.link, width=390, height=844)
    page.wait_for_url(re.compile(r"/$"))
    page.goto(f"{console.address}/robots")
    expect(page.locator("#robots img").first).to_be_visible()
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    expect(page.get_by_role("button", name="Stop all")).to_be_in_viewport()
    take_picture(page, "robots-phone")
    page.get_by_role("button", name="Stop all").click()
    expect(page.locator("#stopped")).to_be_visible()
