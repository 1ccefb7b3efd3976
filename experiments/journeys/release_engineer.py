"""The release engineer: reads the candidate in review, decides, proposes by knobs, is refused, starts an evaluation."""

import re

from playwright.sync_api import expect

from experiments.journeys.walk import JourneyWalk

NAME, PASSWORD = "lea", "seven green bottles"
OPTIONS = ("--robots", "vbot-1", "--start", "circuit", "--start-now")
"""A console that shows the shipped candidate in review, beside one mission."""


def walk(way: JourneyWalk, link: str) -> dict[str, float]:
    """From the first link to a decision, a proposal, a refusal, a comparison and an evaluation under way."""
    page = way.page
    with way.step("sign in by the link, and make an account of one's own"):
        way.enter(link)
        way.section("Account")
        way.follow("Make your account")
        form = page.locator('form[action="/account/people"]')
        form.locator('input[name="name"]').fill(NAME)
        form.locator('input[name="password"]').fill(PASSWORD)
        for role in ("operator", "reviewer", "releaser"):
            box = form.locator(f'input[value="{role}"]')
            if not box.is_checked():
                way.click(box)
        way.click(form.locator("button.primary"))
        page.locator('input[name="name"]').fill(NAME)
        page.locator('input[name="password"]').fill(PASSWORD)
        way.press("Sign in")
        page.wait_for_url(re.compile(r"/$"))
    with way.step("open the candidate that waits"):
        way.section("Candidates")
        page.wait_for_url(re.compile("/candidates"))
        way.click(page.locator("main table td a").first)
        expect(page.locator("#approve")).to_be_visible()
    with way.step("approve it as a reviewer, by holding"):
        page.locator("#reason").fill("the intervals hold")
        way.hold(page.locator("#approve"))
        expect(page.locator("main")).to_contain_text("authorise")
    with way.step("propose another change by one knob"):
        way.section("Candidates")
        way.follow("Propose a change")
        way.follow("weight of history")
        page.locator('textarea[name="reason"]').fill("History tells who fails here")
        page.locator('input[name="intended_effect"]').fill("Choose who did better before")
        page.locator('input[name="routing.history"]').fill("0.6")
        way.click(page.locator("#check"))
        expect(page.locator("main")).to_contain_text("No rule is broken")
        way.click(page.locator("#propose"))
        expect(page.locator("h1")).to_have_text("Choose who did better before")
    with way.step("see what its evaluation would cost, start it, and cancel it"):
        way.click(page.locator("#evaluate"))
        way.click(page.locator("#cancel-evaluation"))
        expect(page.locator("#cancel-evaluation")).to_have_count(0)
    with way.step("be refused what loosens, and find it kept with its reasons"):
        way.section("Candidates")
        way.follow("Propose a change")
        way.follow("As JSON, task templates too")
        text = page.locator('textarea[name="configuration"]')
        text.fill(re.sub(r'("minimum_confidence": )[0-9.]+', r"\g<1>0.0", text.input_value(), count=1))
        page.locator('textarea[name="reason"]').fill("Fewer questions")
        page.locator('input[name="intended_effect"]').fill("Accept what is less sure")
        way.click(page.locator("#propose"))
        way.click(page.locator("#kept a"))
        expect(page.locator("main")).to_contain_text("Accept what is less sure")
    with way.step("put both candidates side by side"):
        way.section("Candidates")
        page.wait_for_url(re.compile("/candidates$"))
        way.click(page.locator("main table td a").first)
        way.follow("Compare")
        expect(page.locator("h1")).to_contain_text("side by side")
        way.click(page.locator("#compare"))
        expect(page.locator("main table thead th")).to_have_count(3)
    with way.step("look at the releases and the metric over them"):
        way.section("Releases")
        expect(page.locator("main")).to_contain_text("The metric over releases")
    return {}
