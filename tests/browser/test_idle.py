"""Who claims by a click is known to be there; the page that then keeps the claim says that nobody asked it to."""

from playwright.sync_api import Request

from tests.browser.conftest import ConsoleWatch, OpenPage
from tests.builders.serving import serving

LITTLE_S = 30.0
"""A claim with so little left is renewed as soon as its page is open."""


def claims(request: Request) -> bool:
    return request.method == "POST" and request.url.endswith("/claim")


def test_a_click_claims_as_a_person_and_its_page_renews_by_itself(
    open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    with serving() as served:
        asked = served.asked
        asked.turn_to(asked.wall_s - LITTLE_S)
        page = served.enter(open_page(), f"/handoffs/{asked.handoff_id}")
        page.wait_for_selector("body[data-link=live]")
        with page.expect_request(claims) as clicked:
            page.locator("#claim").click()
        headers = clicked.value.all_headers()
        assert headers["hx-request"] == "true" and "x-by-itself" not in headers
        page.locator("form[data-keep]").wait_for(state="attached")
        with page.expect_request(claims) as renewed:
            page.reload()
        assert renewed.value.all_headers()["x-by-itself"] == "yes"
        response = renewed.value.response()
        assert response is not None and response.status in (0, 200, 303)
