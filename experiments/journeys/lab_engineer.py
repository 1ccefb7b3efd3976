"""The lab engineer: starts a mission in words, follows it, and takes an accepted fact apart down to its bytes."""

import re

from playwright.sync_api import expect

from experiments.journeys.walk import JourneyWalk

OPTIONS = ("--robots", "vbot-1")
GOAL = "Check the storage area and come back"


def walk(way: JourneyWalk, link: str) -> dict[str, float]:
    """From the first link over a mission in words to a dispute and a regression case."""
    page = way.page
    with way.step("sign in and say in words what is to be done"):
        way.enter(link)
        way.follow("start a mission")
        page.locator('select[name="template"]').select_option("warehouse-inspection")
        page.wait_for_url(re.compile("template=warehouse-inspection"))
        page.locator('textarea[name="goal"]').fill(GOAL)
        way.press("Preview the contract")
        expect(page.locator("main")).to_contain_text("Preview, not saved")
    with way.step("start it"):
        way.press("Start")
        page.wait_for_url(re.compile(r"/missions/msn_"))
        expect(page.locator("#stages")).to_be_visible()
    with way.step("follow it to its end without touching the page"):
        expect(page.locator("#head")).to_contain_text("succeeded")
    with way.step("open its report, which opens with what was found"):
        way.follow("Report")
        expect(page.locator("main")).to_contain_text("obstructed")
    with way.step("follow one accepted fact down to its bytes"):
        way.click(page.locator('a[href*="/facts/"]').first)
        way.click(page.locator('main a[href^="/evidence/"]').first)
        expect(page.locator("main")).to_contain_text("sha256")
    with way.step("look at all evidence, with pictures"):
        way.section("Evidence")
        expect(page.locator("main table img").first).to_be_visible()
    with way.step("change a place's other names"):
        way.section("Places")
        way.click(page.locator('main a[href$="/edit"]').first)
        names = page.locator('[name="aliases"]')
        names.fill(f"{names.input_value()}, the garage")
        page.locator('main form.panel [name="reason"]').fill("people call it so")
        way.click(page.locator("main form.panel button.primary"))
        expect(page.locator("main")).to_contain_text("the garage")
    return {}
