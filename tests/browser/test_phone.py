"""At 390 px: no page scrolls sideways, and stop and answer stay in reach of a thumb."""

from playwright.sync_api import expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import hold, serving

WIDTH, HEIGHT, THUMB = 390, 844, 44


def test_stop_stays_in_view_however_far_down_a_phone_is_scrolled(
    open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    with serving() as served:
        page = served.enter(open_page(width=WIDTH, height=HEIGHT), f"/missions/{served.asked.mission_id}")
        page.mouse.wheel(0, 20_000)
        page.wait_for_timeout(300)
        stop = page.locator("#bar button.stop").first
        expect(stop).to_be_in_viewport()
        box = stop.bounding_box()
        assert box is not None and box["height"] >= THUMB and box["width"] >= THUMB
        take_picture(page, "mission-phone", whole=False)
        stop.click()
        expect(page.locator("#stopped")).to_contain_text("was sent after")
        assert served.asked.mission.stop is not None


def test_a_phone_leads_from_the_overview_to_the_answer_in_two_taps(
    open_page: OpenPage, take_picture: TakePicture
) -> None:
    with serving() as served:
        page = served.enter(open_page(width=WIDTH, height=HEIGHT))
        take_picture(page, "overview-phone")
        page.locator("main a[href^='/handoffs/']").first.click()
        page.wait_for_selector("body[data-link=live]")
        reject = page.locator("#reject")
        page.get_by_role("button", name="not safe").click()
        reject.scroll_into_view_if_needed()
        box = reject.bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= WIDTH and box["height"] >= THUMB
        hold(page, "#reject")
        expect(page.locator(".steps")).to_contain_text("not safe")
        assert served.asked.handoff.status == "rejected"


def test_empty_rooms_say_why_they_are_empty_and_what_to_do(open_page: OpenPage) -> None:
    with serving(waits=False) as served:
        page = served.enter(open_page(width=WIDTH, height=HEIGHT))
        for path in ("/", "/missions", "/handoffs", "/alerts", "/evidence", "/queue"):
            served.open(page, path)
            text = page.locator(".empty").first.inner_text()
            assert len(text.split()) >= 4, (path, text)


def test_rows_of_lists_stand_on_end_with_every_column_named_and_nothing_cut(open_page: OpenPage) -> None:
    with serving() as served:
        page = served.enter(open_page(width=WIDTH, height=HEIGHT))
        log = f"/missions/{served.asked.mission_id}/log"
        for path in ("/", "/missions", "/handoffs", "/evidence", "/memory", "/audit", "/places", log):
            served.open(page, path)
            cut = page.locator(".scroll:has(:is(.list, .stacked))").evaluate_all(
                "boxes => boxes.filter(box => box.scrollWidth > box.clientWidth).length"
            )
            assert cut == 0, path
        served.open(page, "/missions")
        verdict = page.locator("td[data-column='goal verdict']").first
        said = verdict.evaluate("cell => getComputedStyle(cell, '::before').content")
        assert said == '"goal verdict"'
        expect(verdict).to_be_in_viewport()
