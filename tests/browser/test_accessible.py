"""Every page of the console under axe, light and dark, at desktop and phone width, with what its policy forbids."""

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import Serving, serving

LEVELS: dict[str, object] = {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]}
CONTRAST: dict[str, object] = {"type": "rule", "values": ["color-contrast"]}
SIZES: dict[str, object] = {"type": "rule", "values": ["target-size"]}
PHONE = 390
WATCHING = (
    "/", "/missions", "/missions/{ended}", "/missions/{ended}/report", "/missions/{ended}/log", "/alerts", "/robots",
    "/robots/vbot-1", "/queue", "/evidence", "/providers", "/places", "/memory", "/audit", "/account",
    "/account/people", "/fleet", "/recordings", "/shadow", "/routes/new", "/own-missions", "/own-missions/new",
    "/own-robots", "/own-robots/new",
)  # fmt: skip
DECIDING = (
    "/missions/new", "/missions/{asking}/stop", "/handoffs", "/handoffs/{handoff}", "/robots/vbot-1/drive",
    "/robots/stop",
)  # fmt: skip


def broken(page: Page, rules: dict[str, object]) -> list[str]:
    """What axe finds in the page itself; the 3D frame is viser's own. What passes is not listed. A page that has axe
    already keeps it: loading it takes longer than looking.
    """
    options = {"runOnly": rules, "iframes": False, "resultTypes": ["violations"]}
    if not page.evaluate("'axe' in window"):
        page.evaluate(Axe().axe_script)
    found = page.evaluate("options => axe.run(options).then(found => found.violations)", options)
    return [f"{one['id']}: {node['html'][:160]}" for one in found for node in one["nodes"]]


def found(served: Serving, page: Page, path: str) -> list[str]:
    """Everything wrong with one page."""
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 800})
    served.open(page, path)
    wrong = [f"{path} light {one}" for one in broken(page, LEVELS)]
    page.emulate_media(color_scheme="dark")
    wrong += [f"{path} dark {one}" for one in broken(page, CONTRAST)]
    page.set_viewport_size({"width": PHONE, "height": 844})
    wrong += [f"{path} phone {one}" for one in broken(page, SIZES)]
    width = page.evaluate("document.documentElement.scrollWidth")
    return [*wrong, f"{path} is {width} px wide on a phone"] if width > PHONE else wrong


def addresses(served: Serving, paths: tuple[str, ...]) -> list[str]:
    named = {"ended": served.ended, "asking": served.asked.mission_id, "handoff": served.asked.handoff_id}
    return [path.format(**named) for path in paths]


@pytest.mark.parametrize("paths", [WATCHING, DECIDING], ids=["watching", "deciding"])
def test_axe_finds_nothing_on_any_page_in_light_dark_or_at_phone_width(
    paths: tuple[str, ...], open_page: OpenPage, console_watch: ConsoleWatch
) -> None:
    with serving(finished=paths is WATCHING, waits=paths is DECIDING) as served:
        page = served.enter(open_page())
        assert [wrong for path in addresses(served, paths) for wrong in found(served, page, path)] == []


def test_a_page_with_an_unnamed_button_and_pale_words_is_found(open_page: OpenPage) -> None:
    page = open_page()
    page.set_content(
        '<html lang="en"><title>t</title><main><h1>x</h1><button></button><p id="p">pale</p></main></html>'
    )
    page.evaluate("document.getElementById('p').style.color = '#ccc'")
    rules = {one.split(":")[0] for one in broken(page, LEVELS)}
    assert {"button-name", "color-contrast"} <= rules


def test_the_sign_in_and_refusal_pages_hold_too(open_page: OpenPage, console_watch: ConsoleWatch) -> None:
    console_watch.expect("401|404")
    with serving(waits=False) as served:
        page = open_page(served.address + "/account/sign-in")
        assert broken(page, LEVELS) == []
        served.open(page, "/")
        assert broken(page, LEVELS) == []
        served.enter(page, "/nowhere")
        assert broken(page, LEVELS) == []


def test_who_wants_less_motion_sees_none_and_print_hides_what_paper_cannot_press(
    open_page: OpenPage, take_picture: TakePicture
) -> None:
    with serving(finished=True, waits=False) as served:
        page = served.enter(open_page(), f"/missions/{served.ended}/report")
        page.emulate_media(reduced_motion="reduce")
        assert page.locator("button").first.evaluate("(one) => getComputedStyle(one).transitionDuration") == "0s"
        page.emulate_media(media="print")
        assert not page.locator("#bar").is_visible()
        assert not page.locator("#rail").is_visible()
        assert not page.locator(".foot").is_visible()
        assert page.locator("h1").is_visible()
        take_picture(page, "report-print")
