"""The link breaks and comes back: the page says so within two seconds, and nothing moves under the pointer."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import FloatRect, Page, Route, expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import Serving, serving
from tests.builders.silence import listen, silent_ms
from tests.builders.timeouts import wait_until
from tests.builders.waiting import BOB
from tests.builders.wires import Wire, wire

LOST = "body[data-link=lost]"
LIVE = "body[data-link=live]"
BROKEN = "ERR_|Failed to load|Failed to fetch|network"
MOVED_ON = """document.addEventListener("readystatechange", () => {
    if (document.readyState === "interactive") document.body.dataset.position = "-1";
})"""
"""The console went on between the page and its stream, which then sends it another position than its own."""


@pytest.fixture
def cable() -> Iterator[Wire]:
    with wire() as made:
        yield made


@pytest.fixture
def served(cable: Wire) -> Iterator[Serving]:
    with serving(wire=cable) as made:
        yield made


def at(page: Page, selector: str) -> FloatRect:
    """Where a control is drawn now."""
    box = page.locator(selector).bounding_box()
    assert box is not None
    return box


def deciding(served: Serving, page: Page) -> Page:
    """The question is open, a reason is typed, and the pointer rests on Reject."""
    served.enter(page, f"/handoffs/{served.asked.handoff_id}")
    expect(page.locator(LIVE)).to_have_count(1)
    page.locator("#reason").fill("somebody stands there")
    page.locator("#reject").scroll_into_view_if_needed()
    page.locator("#reject").hover()
    return page


def test_a_lost_link_is_said_within_two_seconds_and_buttons_rest_until_it_is_back(
    served: Serving, cable: Wire, open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    console_watch.expect(BROKEN)
    page = open_page()
    listen(page)
    deciding(served, page)
    before = at(page, "#reject")
    cable.cut()
    page.wait_for_selector(LOST)
    assert silent_ms(page) < 2000
    expect(page.locator("#status")).to_contain_text("Not live since")
    expect(page.locator("#question")).to_have_attribute("data-stale", "not live since " + _since(page))
    expect(page.locator("#reject")).to_be_disabled()
    assert at(page, "#reject") == before
    take_picture(page, "network-lost")
    cable.mend()
    page.wait_for_selector(LIVE)
    expect(page.locator("#reject")).to_be_enabled()
    expect(page.locator("[data-stale]")).to_have_count(0)
    expect(page.locator("#drops")).to_contain_text("reconnects: 1")
    assert at(page, "#reject") == before
    assert page.locator("#reason").input_value() == "somebody stands there"


def test_what_somebody_else_decided_meanwhile_leaves_nothing_to_press_under_the_pointer(
    served: Serving, cable: Wire, open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    console_watch.expect(BROKEN)
    page = deciding(served, open_page())
    box = at(page, "#reject")
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    cable.cut()
    page.wait_for_selector(LOST)
    served.asked.decide("reject", actor=BOB, reason="not safe")
    cable.mend()
    page.wait_for_selector(LIVE)
    expect(page.locator("#question")).to_contain_text("bob")
    under = page.evaluate(
        "([x, y]) => document.elementFromPoint(x, y)?.closest('button:not(:disabled), a.button')?.id ?? ''", middle
    )
    assert under == ""


def test_a_3d_view_that_is_still_being_read_is_not_left_halfway_and_opened_anew_after_a_lost_link(
    served: Serving, cable: Wire, open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    console_watch.expect(BROKEN)
    page = open_page(viewer=True)
    served.enter(page)
    reads: list[Route] = []
    view = '<!doctype html><script src="held.js"></script>'
    page.route("**/scene/*/", lambda route: route.fulfill(content_type="text/html", body=view))
    page.route("**/held.js", lambda route: reads.append(route))
    page.add_init_script(MOVED_ON)
    page.goto(f"{served.address}/missions/{served.asked.mission_id}", wait_until="commit")
    wait_until(page, lambda: len(reads) == 1, "a 3D view of which a part is missing")
    page.wait_for_selector(LIVE)
    lose(page, cable)
    assert len(reads) == 1
    reads[0].fulfill(body="")
    wait_until(page, lambda: len(reads) == 2, "a 3D view that is opened anew once it was read")
    reads[1].fulfill(body="")
    state = "frame => frame.contentDocument.readyState"
    wait_until(page, lambda: page.locator(".scene iframe").evaluate(state) == "complete", "a whole 3D view")
    lose(page, cable)
    wait_until(page, lambda: len(reads) == 3, "a whole 3D view that is opened anew at once")


def lose(page: Page, cable: Wire) -> None:
    """The link is lost and comes back."""
    cable.cut()
    page.wait_for_selector(LOST)
    cable.mend()
    page.wait_for_selector(LIVE)


def _since(page: Page) -> str:
    return page.locator("#status").inner_text().removeprefix("Not live since ").split(".")[0]
