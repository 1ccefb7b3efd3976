"""People change the harness in a browser: from a proposal over review, release and canary to a rollback, and back.

The console runs in this process over a kinematic robot in virtual time; missions are run by the tests.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from threading import Thread

import pytest
import uvicorn
from playwright.sync_api import Page, expect
from pydantic import SecretStr

from app.auth.permissions import Principal
from app.background.signals import SignalBroker
from app.main import bind, create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from rsi_reviews.acceptance import accepted
from rsi_reviews.release_service import ReleaseService
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.browser.test_accessible import CONTRAST, LEVELS, broken
from tests.builders.accounts import quick_accounts
from tests.builders.harness_with_signals import harness_with_signals
from tests.builders.releases import LAUNCHER, PREDICATE, Bench, candidate, evaluation, routed, say, terms_of
from tests.builders.releases import expect as taken
from tests.builders.timeouts import TIMEOUT_S

PASSWORD = "seven green bottles"
PEOPLE = {
    "ada": ["admin"],
    "lea": ["operator", "reviewer", "releaser"],
    "rob": ["reviewer"],
    "ria": ["reviewer"],
    "sam": ["releaser"],
}


@dataclass(frozen=True)
class Served:
    """A console that answers, with people of its own, and the desk behind it."""

    address: str
    bench: Bench
    open_page: OpenPage
    pages: list[Page] = field(default_factory=list)

    def enter(self, name: str, path: str = "/candidates", *, width: int = 1280, scripts: bool = True) -> Page:
        """Somebody signs in and opens a page; it is closed before the console ends."""
        page = self.open_page(f"{self.address}/account/sign-in", width=width, scripts=scripts)
        self.pages.append(page)
        page.locator('input[name="name"]').fill(name)
        page.locator('input[name="password"]').fill(PASSWORD)
        page.locator('input[name="password"]').press("Enter")
        page.wait_for_url(re.compile(r"/$"))
        page.goto(self.address + path)
        return page


@pytest.fixture
def served(open_page: OpenPage) -> Iterator[Served]:
    broker = SignalBroker()
    with harness_with_signals(broker) as harness:
        listener = bind(0)
        port = listener.getsockname()[1]
        console = ConsoleSettings(port=port, robots=("vbot-1",), owner_token=SecretStr("t"), password_memory_kib=19456)
        app = create_app(
            harness.runtime,
            console,
            broker,
            Scenes(harness.runtime),
            accounts=quick_accounts(console),
            answer=harness.supervisor.answer,
            starts=harness.starts,
        )
        for name, roles in PEOPLE.items():
            by = Principal(name="setup", roles=("admin",), source="test")
            app.state.sessions.accounts.add(name, roles=roles, password=PASSWORD, by=by)
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        releases = ReleaseService(harness.runtime, judge=partial(accepted, predicate=PREDICATE))
        found = Served(f"http://127.0.0.1:{port}", Bench(harness=harness, releases=releases), open_page)
        try:
            yield found
        finally:
            for page in found.pages:
                page.context.close()
            broker.close()
            server.should_exit = True
            thread.join(timeout=TIMEOUT_S)
            listener.close()


def hold(page: Page, word: str, reason: str) -> None:
    """Type why, press and hold until it is sent, and arrive on the page after it."""
    page.locator("#reason").fill(reason)
    button = page.locator(f"#{word}")
    button.scroll_into_view_if_needed()
    button.hover()
    with page.expect_navigation():
        page.mouse.down()
    page.mouse.up()


def test_from_a_proposal_to_a_release_and_back_again(served: Served, take_picture: TakePicture) -> None:
    bench = served.bench
    shipped = bench.releases.current()
    author = served.enter("lea", "/candidates/new")
    author.get_by_role("link", name="weight of history").click()
    author.locator('textarea[name="reason"]').fill("History tells who fails here")
    author.locator('input[name="intended_effect"]').fill("Choose who did better before")
    author.locator('input[name="routing.history"]').fill("0.6")
    author.locator("#check").click()
    expect(author.locator("main")).to_contain_text("No rule is broken")
    author.locator("#propose").click()
    expect(author.locator("h1")).to_have_text("Choose who did better before")
    name = author.url.rpartition("/")[2]
    made = bench.releases.candidate(name)
    taken(bench.releases.begin(terms_of(made), say(LAUNCHER)))
    expect(author.locator(".head .pill")).to_have_text("evaluating")
    taken(bench.releases.submit_results(evaluation(made), say(LAUNCHER)))
    expect(author.locator(".head .pill")).to_have_text("accepted")
    author.locator("#reason").fill("every clause passes")
    author.locator("#submit").click()
    expect(author.locator("#approve")).to_be_disabled()
    expect(author.locator("#why-approve")).to_contain_text("lea is an author of it")
    reviewer, releaser = served.enter("rob", f"/candidates/{name}"), served.enter("sam", f"/candidates/{name}")
    take_picture(reviewer, "review-light")
    hold(reviewer, "approve", "the intervals hold")
    expect(releaser.locator("#words")).to_be_visible()
    expect(releaser.locator("#authorise")).to_be_enabled()
    hold(releaser, "authorise", "two people agree")
    hold(releaser, "release", "first on one robot")
    expect(releaser.locator("#canary")).to_contain_text("0 of 5")
    for number in range(5):
        bench.mission()
        expect(reviewer.locator("#canary")).to_contain_text(f"{number + 1} of 5")
        form = reviewer.locator("#canary form")
        form.locator('input[name="reason"]').fill("looked at its report")
        form.get_by_role("button").click()
        expect(reviewer.locator("#canary form")).to_have_count(0)
    expect(reviewer.locator(".head .pill").first).to_have_text("current")
    releaser.goto(served.address + "/releases")
    expect(releaser.locator(".current")).to_contain_text("Choose who did better before")
    take_picture(releaser, "releases-light")
    releaser.get_by_role("link", name="Roll back").click()
    releaser.locator("#reason").fill("slower than before")
    releaser.locator("#rollback").click()
    expect(releaser.locator(".head .pill").first).to_have_text("rolled back")
    assert bench.releases.current() == shipped
    reviewer.goto(served.address + "/releases")
    expect(reviewer.locator("#now")).to_contain_text("quarantined")


def test_the_second_of_two_reviewers_is_told_who_decided_what(served: Served, console_watch: ConsoleWatch) -> None:
    console_watch.expect("409")
    name = served.bench.in_review(candidate())
    first = served.enter("rob", f"/candidates/{name}")
    second = served.enter("ria", f"/candidates/{name}", scripts=False)
    first.locator("#reason").fill("too small an effect")
    first.locator("#reject").click()
    expect(first.locator(".head .pill").first).to_have_text("rejected")
    second.locator("#reason").fill("looks good")
    second.locator("#approve").click()
    expect(second.locator("#errors")).to_contain_text("rob: rejected at")
    expect(second.locator("#errors")).to_contain_text("too small an effect")


def test_a_review_goes_stale_while_it_is_open_when_another_candidate_becomes_current(served: Served) -> None:
    name = served.bench.in_review(candidate())
    page = served.enter("rob", f"/candidates/{name}")
    expect(page.locator("#approve")).to_be_enabled()
    served.bench.current(routed(), look=2)
    expect(page.locator(".callout").first).to_contain_text("is no longer current")
    expect(page.locator("#approve")).to_be_disabled()
    expect(page.locator("#why-approve")).to_contain_text("is no longer current")


def test_a_cycle_that_moves_on_under_a_reader_turns_the_buttons_off(served: Served) -> None:
    name = served.bench.in_review(candidate())
    page = served.enter("rob", f"/candidates/{name}")
    page.locator("#reason").fill("half a sen")
    releases = served.bench.releases
    taken(releases.recall(name, say(LAUNCHER)))
    taken(releases.submit(name, say(LAUNCHER)))
    expect(page.locator("#words [data-changed]")).to_be_visible()
    expect(page.locator("#approve")).to_be_disabled()
    expect(page.locator("#reason")).to_have_value("half a sen")


def test_a_canary_that_fails_goes_back_by_itself(served: Served) -> None:
    shipped = served.bench.releases.current()
    name = served.bench.in_canary(routed())
    page = served.enter("ria", f"/candidates/{name}")
    served.bench.mission()
    form = page.locator("#canary form")
    form.locator("select").select_option("false_completion")
    form.locator('input[name="reason"]').fill("it never reached the shelf")
    form.get_by_role("button").click()
    expect(page.locator(".head .pill").first).to_have_text("rolled back")
    expect(page.locator("#canary")).to_contain_text("it never reached the shelf")
    assert served.bench.releases.current() == shipped


def test_one_person_alone_needs_the_single_operator_policy(served: Served) -> None:
    name = served.bench.in_review(candidate())
    author = served.enter("lea", f"/candidates/{name}")
    expect(author.locator("#approve")).to_be_disabled()
    admin = served.enter("ada", "/releases")
    admin.get_by_text("Change the policy").click()
    admin.get_by_label("single operator").check()
    admin.locator('input[name="cooling_off_h"]').fill("0.00001")
    admin.get_by_label("Reason, kept with the policy").fill("nobody else for a month")
    admin.locator("#save-policy").click()
    expect(admin.locator("#policy")).to_contain_text("an author may decide alone")
    expect(author.locator("#approve")).to_be_enabled()
    hold(author, "approve", "alone this month")
    expect(author.locator(".said")).to_contain_text("by the single-operator policy")


def test_on_a_phone_nothing_is_cut_off_and_axe_finds_nothing(served: Served, take_picture: TakePicture) -> None:
    name = served.bench.in_canary(routed())
    served.bench.mission()
    page = served.enter("rob", width=390)
    draft = served.bench.proposed(candidate())
    compared, knob = f"/candidates/compare?a={name}&b={draft}", "/candidates/new?knobs=recovery.ladders.violated"
    looked = (f"/candidates/{name}", "/candidates", "/candidates/new", knob, compared, "/releases")
    for path in (*looked, *(f"/candidates/{name}/{part}" for part in ("cases", "replay", "rollback")), "/evaluation"):
        page.goto(served.address + path)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, path
        assert path not in looked or broken(page, LEVELS) == [], path
    page.goto(f"{served.address}/releases")
    look = page.locator("tr", has_text="look 1").locator("time").bounding_box()
    assert look is not None and look["x"] + look["width"] <= 390
    wide = page.locator(".scroll:has(.stacked)")
    assert wide.evaluate_all("boxes => boxes.filter(box => box.scrollWidth > box.clientWidth).length") == 0
    page.goto(f"{served.address}/candidates/{name}")
    take_picture(page, "review-phone")
    page.emulate_media(color_scheme="dark")
    assert broken(page, CONTRAST) == []
