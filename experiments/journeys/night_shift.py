"""The night shift: something stands in a robot's way, somebody moves it; another one is stopped and sent to safety."""

import re
import time

from playwright.sync_api import expect

from experiments.journeys.walk import JourneyWalk

OPTIONS = (
    "--robots", "vbot-1,vbot-2", "--start", "warehouse-inspection", "--fault", "vbot-2=blocked-passage:persistent",
)  # fmt: skip
"""What `make run` starts."""


def walk(way: JourneyWalk, link: str) -> dict[str, float]:
    """From the first link to a finished mission and a robot at its safe place. Returns what was measured beside."""
    page = way.page
    with way.step("sign in and see the site"):
        way.enter(link)
        expect(page.locator("#map-title")).to_be_visible()
    with way.step("wait for the first handoff, told on every page"):
        expect(page.get_by_role("link", name="asks you").first).to_be_visible()
    with way.step("open it: picture, map, why, action and countdown on one screen"):
        way.follow("asks you")
        for name in ("#approve", "#reject", "[data-countdown]"):
            expect(page.locator(name).first).to_be_in_viewport()
    with way.step("have the obstacle taken away"):
        way.click(page.locator("#clear-way"))
        expect(page.locator("#approve")).to_be_visible()
    with way.step("propose the same stage again"):
        offered = page.locator('[data-offer="retry"]')
        if offered.count():
            way.click(offered.first)
        expect(page.locator(".decide")).to_contain_text("Try the same stage again")
    with way.step("approve, by holding"):
        way.click(page.locator("[data-reason]").first)
        way.hold(page.locator("#approve"), lambda: _fresh(way))
        expect(page.locator(".steps")).to_contain_text("approved")
    with way.step("follow the mission to its end"):
        expect(page.locator(".steps")).to_contain_text(re.compile("confirmed|failed"))
        way.section("Missions")
        way.click(page.get_by_role("link", name=re.compile("Inspect", re.I)).first)
        expect(page.locator("#head")).to_contain_text("succeeded")
    with way.step("read its report"):
        way.follow("Report")
        expect(page.locator("h1")).to_be_visible()
    with way.step("start a circuit on vbot-1"):
        way.follow("Start a mission")
        page.locator('select[name="template"]').select_option("circuit")
        page.wait_for_url(re.compile("template=circuit"))
        way.press("Start")
        page.wait_for_url(re.compile(r"/missions/msn_"))
        expect(page.locator("#stop-vbot-1")).to_have_attribute("data-state", "running")
        expect(page.locator("#stages")).to_contain_text("running")
    measured: dict[str, float] = {}
    with way.step("stop it, by one press, and say why afterwards"):
        began_s = time.monotonic()
        way.click(page.locator("#stop-vbot-1"))
        answer = page.locator("#stopped-text")
        expect(answer).to_contain_text("was sent after")
        measured["stop_seen_ms"] = round(1000 * (time.monotonic() - began_s))
        measured["stop_taken_up_ms"] = float(re.findall(r"after (\d+) ms", answer.inner_text())[0])
        way.click(page.locator("#stopped [data-reason]").first)
        way.click(page.locator("#stopped").get_by_role("button", name="Save the reason"))
        expect(page.locator("#head")).to_contain_text("cancelled")
    with way.step("send it to safety and see it arrive, measured"):
        way.section("Robots")
        way.click(page.locator("main").get_by_role("link", name="vbot-1").first)
        page.locator('form[action$="/safe"] input[name="reason"]').fill("end of the shift")
        way.press("Stop and go to safety")
        expect(page.locator("main")).to_contain_text(re.compile("measured|arrived", re.I))
    with way.step("acknowledge what is left in the alerts"):
        way.section("Alerts")
        button = page.get_by_role("button", name="Acknowledge")
        if button.count():
            way.click(button.first)
        expect(page.locator("h1")).to_be_visible()
    return measured


def _fresh(way: JourneyWalk) -> None:
    """A picture that is too old is taken again; the page offers it in the place of the approval."""
    instead = way.page.locator("#look-now")
    if instead.is_visible():
        way.click(instead)
        expect(way.page.locator("#approve")).to_be_visible()
