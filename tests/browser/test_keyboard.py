"""Keys alone: from the form that starts a mission to its report, and through the handoff gate, with the focus seen."""

import re

from playwright.sync_api import Page, expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import LET_GO_EARLY, serving

SEEN = """() => { const one = document.activeElement, style = getComputedStyle(one), box = one.getBoundingClientRect();
    return one !== document.body && style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2
        && box.width > 0 && box.bottom > 0 && box.top < innerHeight; }"""
FAR = 90


def tab_to(page: Page, selector: str) -> None:
    """Press Tab until a control has the focus; everything passed on the way shows its focus and can be left."""
    for _ in range(FAR):
        page.keyboard.press("Tab")
        assert page.evaluate(SEEN), page.evaluate("document.activeElement.outerHTML.slice(0, 200)")
        if page.locator(selector).first.evaluate("(one) => one === document.activeElement"):
            return
    raise AssertionError(f"{FAR} tabs do not lead to {selector}")


def test_keys_alone_lead_from_the_start_form_to_the_report(open_page: OpenPage, console_watch: ConsoleWatch) -> None:
    with serving(waits=False) as served:
        page = served.enter(open_page())
        tab_to(page, ".skip")
        page.keyboard.press("Enter")
        expect(page.locator("#main")).to_be_focused()
        page.keyboard.press("g")
        page.keyboard.press("s")
        page.wait_for_url(re.compile("/missions/new"))
        tab_to(page, "[name=goal]")
        page.keyboard.press("Control+a")
        page.keyboard.type("Walk once round and come back")
        tab_to(page, "#start-form button.primary")
        page.keyboard.press("Enter")
        page.wait_for_url(re.compile(r"/missions/msn_"))
        mission = served.asked.runtime.missions()[0]
        assert served.run(mission.mission_id) == "succeeded"
        expect(page.locator("#head")).to_contain_text("This mission has ended")
        tab_to(page, "#head a[href$='/report']")
        page.keyboard.press("Enter")
        page.wait_for_url(re.compile("/report"))
        expect(page.locator("h1")).to_contain_text("walk the route circuit; return")
        expect(page.locator("main")).to_contain_text("asked as “Walk once round and come back”")


def test_keys_alone_lead_through_the_handoff_gate(open_page: OpenPage, take_picture: TakePicture) -> None:
    with serving() as served:
        page = served.enter(open_page())
        page.keyboard.press("g")
        page.keyboard.press("h")
        page.wait_for_url(re.compile("/handoffs"))
        tab_to(page, "#list a.strong")
        page.keyboard.press("Enter")
        page.wait_for_url(re.compile("/handoffs/hof_"))
        tab_to(page, "#claim")
        page.keyboard.press("Enter")
        expect(page.locator(".holding")).to_contain_text("You have claimed it")
        expect(page.locator("#claim")).to_be_focused()
        tab_to(page, "#look")
        served.asked.turn_to_now()
        with page.expect_navigation():
            page.keyboard.press("Enter")
        tab_to(page, "#reason")
        page.keyboard.type("seen on camera")
        tab_to(page, "#approve")
        take_picture(page, "handoff-keyboard", whole=False)
        page.locator("#approve").evaluate(LET_GO_EARLY)
        expect(page.locator("#status")).to_contain_text("Let go too early")
        assert served.asked.handoff.status == "claimed"
        page.keyboard.down("Enter")
        expect(page.locator(".steps")).to_contain_text("Decision applied at event")
        page.keyboard.up("Enter")
        assert served.asked.handoff.status in ("approved", "dispatched")


def test_the_cheat_sheet_opens_by_key_and_by_button_and_gives_the_focus_back(open_page: OpenPage) -> None:
    with serving(waits=False) as served:
        page = served.enter(open_page())
        page.keyboard.press("?")
        expect(page.locator("#keys")).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.locator("#keys")).not_to_be_visible()
        page.locator(".foot [data-help]").click()
        expect(page.locator("#keys")).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.locator(".foot [data-help]")).to_be_focused()


def test_a_new_question_takes_no_focus_and_calls_only_who_asked_for_it(open_page: OpenPage) -> None:
    with serving(waits=False) as served:
        silent, called = served.enter(open_page(), "/missions/new"), served.enter(open_page())
        called.locator("[data-call]").click()
        expect(called.locator("[data-call]")).to_have_attribute("aria-pressed", "true")
        silent.locator("[name=goal]").focus()
        served.asked.asked()
        expect(silent.locator("#rail .count").first).to_be_visible()
        expect(silent.locator("[name=goal]")).to_be_focused()
        expect(called).to_have_title(re.compile("A handoff waits"))
        assert "A handoff waits" not in silent.title()
