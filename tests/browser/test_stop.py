"""The stop on every page: one press, one key, never disabled while a robot can move; the reason comes afterwards."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from harness.contracts.control import CONTROL
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import Serving, serving

ROBOT = "vbot-1"


@pytest.fixture
def served() -> Iterator[Serving]:
    with serving() as one:
        yield one


def live(page: Page) -> Page:
    expect(page.locator("body")).to_have_attribute("data-link", "live")
    return page


def drives_by_hand(served: Serving) -> str:
    """Somebody takes control at the API; returns the session."""
    teleoperation = served.asked.harness.teleoperation
    teleoperation.take(ROBOT, actor=served.asked.mission.stop.actor, device="tablet", reason="out of the way")
    session: str = served.asked.runtime.fold(CONTROL).wheels[ROBOT].session
    return session


def test_one_press_stops_whatever_moves_the_robot_and_the_reason_comes_afterwards(
    served: Serving, open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    page = live(served.enter(open_page(), f"/missions/{served.asked.mission_id}"))
    with page.expect_request("**/robots/vbot-1/stop") as sent:
        page.locator("#stop-vbot-1").click()
    assert "idempotency-key" not in sent.value.headers, "nothing is written before the stop itself"
    panel = page.locator("#stopped")
    expect(panel).to_contain_text("Stop of vbot-1 was sent after")
    assert served.asked.mission.stop is not None and page.url.endswith(served.asked.mission_id)
    take_picture(page, "stop-reason", whole=False)
    panel.get_by_role("button", name="person in the way").click()
    expect(panel.locator("[name=reason]")).to_have_value("person in the way")
    assert served.asked.mission.stop.reason != "person in the way"
    panel.get_by_role("button", name="Save the reason").click()
    expect(panel).to_be_hidden()
    expect(page.locator("#head")).to_contain_text("person in the way")
    assert served.asked.mission.stop.reason == "person in the way"
    served.asked.run()
    ended = served.open(page, f"/missions/{served.asked.mission_id}").locator("#stages")
    expect(ended).to_contain_text("not finished")
    expect(ended).not_to_contain_text("escalated")
    drives_by_hand(served)
    stop = live(served.open(page, "/")).locator("#stop-vbot-1")
    expect(stop).to_have_attribute("data-state", "driven")
    expect(stop).to_be_enabled()
    stop.click()
    expect(page.locator("#stopped")).to_contain_text("Stop of vbot-1 was sent after")
    assert served.asked.runtime.fold(CONTROL).wheels == {}


def test_a_key_stops_from_every_page_also_while_somebody_types_and_without_scripts_a_press_does(
    served: Serving, open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    page = live(served.enter(open_page(), "/missions/new"))
    page.locator("main textarea, main input:not([type=hidden])").first.focus()
    page.keyboard.press("Alt+s")
    expect(page.locator("#stopped")).to_contain_text("was sent after")
    assert served.asked.mission.stop is not None
    plain = served.enter(open_page(scripts=False), "/alerts")
    plain.locator("#stop-vbot-1").click()
    expect(plain.get_by_text("The stop of vbot-1 was sent.")).to_be_visible()
    plain.get_by_label("Reason", exact=True).fill("smelt smoke")
    plain.get_by_role("button", name="Save the reason").click()
    expect(plain).to_have_url(f"{served.address}/robots/{ROBOT}")
