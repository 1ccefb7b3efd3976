"""One cursor for the whole mission page in a browser: scrub, step, play, keys, the address, a phone, two readers in 3D.

The console runs in this process over a mission that ended in virtual time, so that nothing here waits for a robot.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from threading import Thread

import cv2
import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from playwright.sync_api import Page, expect
from pydantic import SecretStr

from app.background.signals import SignalBroker
from app.main import bind, create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.events import MissionCreated
from harness.contracts.ids import MissionId, RobotId
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from simulator.in_process import SIMULATOR
from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.accounts import quick_accounts
from tests.builders.serving import VIEWER
from tests.builders.timeouts import TIMEOUT_S, wait_until


@dataclass(frozen=True)
class Served:
    """A console that answers, and the mission that ended on it."""

    app: FastAPI
    address: str
    mission_id: MissionId

    @property
    def mission(self) -> str:
        return f"{self.address}/missions/{self.mission_id}"

    def enter(self, page: Page) -> None:
        """Sign in and come to the overview."""
        page.goto(self.address + self.app.state.sessions.invite())
        page.wait_for_url(re.compile(r"/$"))


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    settings = HarnessSettings(fidelity="kinematic", speed=0)
    with simulated(settings, simulator=SIMULATOR, seed=1, deciders=DECIDERS, select=selected) as harness:
        order = Start(
            actor=Actor(name="ada", role="operator"), robot_id=RobotId("vbot-1"), template="warehouse-inspection"
        )
        begun = harness.runtime.start(order)
        assert isinstance(begun, Accepted)
        mission_id = next(event.mission_id for event in begun.events if isinstance(event, MissionCreated))
        harness.supervisor.run(mission_id)
        listener = bind(0)
        settings = ConsoleSettings(port=listener.getsockname()[1], robots=("vbot-1",), owner_token=SecretStr("t"))
        broker = SignalBroker()
        app = create_app(
            harness.runtime,
            settings,
            broker,
            Scenes(harness.runtime),
            accounts=quick_accounts(settings),
            answer=harness.supervisor.answer,
            starts=harness.starts,
        )
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield Served(app, f"http://127.0.0.1:{settings.port}", mission_id)
        broker.close()
        server.should_exit = True
        thread.join(timeout=TIMEOUT_S)
        listener.close()


@pytest.fixture
def page(served: Served, open_page: OpenPage, console_watch: ConsoleWatch) -> Page:
    """The mission's page, live."""
    opened = open_page(width=1440, height=900)
    served.enter(opened)
    opened.goto(served.mission)
    expect(opened.locator("body")).to_have_attribute("data-link", "live")
    return opened


def place(page: Page) -> int:
    """Which event the dock says it stands at."""
    found = re.match(r"event (\d+) of \d+", page.locator("#cursor-place").inner_text())
    assert found
    return int(found.group(1))


def lefts(page: Page) -> set[str]:
    """Where the cursor lines of all lanes and plots stand."""
    return set(page.locator("line.cursor").evaluate_all("lines => lines.map(line => line.getAttribute('x1'))"))


def instant(page: Page) -> tuple[int, str | None, set[str]]:
    """What the page shows of its instant: the event, the picture, the cursor lines."""
    return place(page), page.locator("#frames .now img").get_attribute("src"), lefts(page)


def test_keys_step_through_the_events_and_every_region_follows(page: Page, served: Served) -> None:
    page.keyboard.press("Home")
    expect(page).to_have_url(re.compile(r"\?t=0$"))
    expect(page.locator("#head")).to_contain_text("as it was after event")
    expect(page.locator("#stages .stage[data-state=committed]")).to_have_count(0)
    before = place(page)
    for _ in range(6):
        page.keyboard.press("ArrowRight")
    assert place(page) == before + 6
    page.keyboard.press("ArrowLeft")
    assert place(page) == before + 5
    expect(page).to_have_url(re.compile(r"\?at=\d+$"))
    expect(page.locator("#stages .stage[data-state=committed]")).to_have_count(1)
    expect(page.locator("#graph .node[data-state=committed]")).to_have_count(1)
    expect(page.locator("#events tr[aria-current]")).to_have_count(1)
    wait_until(page, lambda: len(lefts(page)) == 1, "one place of all cursor lines")
    page.keyboard.press("End")
    expect(page).to_have_url(served.mission)
    expect(page.locator("#head")).to_contain_text("succeeded")
    expect(page.locator("#follow")).to_have_text("following")


def test_the_instant_in_the_address_survives_a_reload_and_is_the_same_for_another_reader(
    page: Page, served: Served, open_page: OpenPage
) -> None:
    page.locator("#cursor").evaluate(
        "slider => { slider.value = 58.5; slider.dispatchEvent(new Event('input', { bubbles: true })) }"
    )
    expect(page).to_have_url(re.compile(r"\?t=58\.5$"))
    expect(page.locator("#frames figcaption")).to_contain_text("at 00:5")
    wait_until(page, lambda: len(lefts(page)) == 1, "one place of all cursor lines")
    shown = instant(page)
    page.reload()
    wait_until(page, lambda: instant(page) == shown, "the same instant after a reload")
    other = open_page(width=1440, height=900)
    served.enter(other)
    other.goto(page.url)
    wait_until(other, lambda: instant(other) == shown, "the same instant for another reader")


def at_s(page: Page) -> float:
    """The cursor's instant in mission seconds, as the address has it."""
    found = re.search(r"\?t=([0-9.]+)$", page.evaluate("location.search"))
    assert found
    return float(found.group(1))


def test_a_click_on_a_plot_goes_there_and_the_plots_say_what_was_measured(page: Page) -> None:
    plot = page.locator("#plot-distance")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box
    value = page.locator("[data-value=distance]")
    live = value.inner_text()
    page.mouse.click(box["x"] + box["width"] * 0.18, box["y"] + 10)
    expect(value).not_to_have_text(live)
    expect(page.locator("#cursor-time")).to_contain_text(re.compile(r"^00:\d\d\.\d of 0\d:"))
    shown, first_s = value.inner_text(), at_s(page)
    page.mouse.click(box["x"] + box["width"] * 0.26, box["y"] + 10)
    expect(value).not_to_have_text(shown)
    assert at_s(page) > first_s
    drawn = page.locator("[data-value=distance]").inner_text()
    page.wait_for_load_state("networkidle")
    server = page.locator("[data-value=distance]").inner_text()
    assert abs(float(server.split()[0]) - float(drawn.split()[0])) < 0.6


def test_playing_moves_the_cursor_and_no_control_moves_under_the_pointer(page: Page) -> None:
    page.keyboard.press("Home")
    button = page.locator("[data-key=play]")
    page.locator("[data-key=speed]").select_option("4")
    before = button.bounding_box()
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    boxes = []
    for _ in range(12):
        boxes.append(button.bounding_box())
        page.wait_for_timeout(60)
    page.locator("[data-key=speed]").select_option("64")
    assert all(box and before and (box["x"], box["y"]) == (before["x"], before["y"]) for box in boxes)
    expect(button).to_have_attribute("aria-pressed", "false")
    expect(page.locator("#stages .stage[data-state=committed]")).to_have_count(7)


def test_a_stage_chosen_in_the_past_stays_in_the_past(page: Page) -> None:
    page.keyboard.press("Home")
    for _ in range(14):
        page.keyboard.press("ArrowRight")
    expect(page.locator("#stages .stage[data-state=committed]").nth(1)).to_be_visible()
    here = place(page)
    page.locator("#stage-go > a").first.click()
    expect(page).to_have_url(re.compile(r"node=go(&at=\d+)?#evidence$|at=\d+&node=go#evidence$"))
    expect(page.locator("#cursor-place")).to_have_text(re.compile(f"^event {here} of "))
    expect(page.locator("#evidence")).to_contain_text("attempt 1, route-follower")


def test_an_accepted_fact_is_followed_down_to_its_bytes(page: Page) -> None:
    page.locator("#facts a.strong", has_text="arrival").first.click()
    expect(page.locator("h1")).to_have_text("arrival")
    expect(page.locator(".descent > li")).to_have_count(4)
    expect(page.locator(".descent .verdict[data-verdict=satisfied]", has_text="verified").first).to_be_visible()
    page.locator(".descent a.mono").first.click()
    expect(page.locator("h1")).to_contain_text("Blob")


def test_two_readers_see_two_instants_in_3d(
    served: Served, open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch
) -> None:
    console_watch.expect(VIEWER)
    page = open_page(width=1000, height=800, viewer=True)
    served.enter(page)
    page.goto(served.mission)
    expect(page.frame_locator(".scene iframe").locator("canvas").first).to_be_visible()
    other = open_page(width=1000, height=800, viewer=True)
    served.enter(other)
    other.goto(served.mission + "?t=0")
    expect(other.frame_locator(".scene iframe").locator("canvas").first).to_be_visible()

    def apart() -> bool:
        late, early = (light(one.locator(".scene").screenshot()) for one in (page, other))
        return late > early * 1.2 and early > 0

    wait_until(page, apart, "a whole mission that lights more pixels than its beginning")
    take_picture(page, "cursor-end", whole=False)
    take_picture(other, "cursor-begin", whole=False)


def test_the_button_of_the_3d_view_says_whether_it_fills_the_screen(served: Served, open_page: OpenPage) -> None:
    page = open_page(width=1000, height=800)
    served.enter(page)
    page.goto(served.mission)
    button = page.locator("[data-full-screen]")
    expect(button).to_have_text("Full screen")
    button.click()
    expect(button).to_have_text("Leave full screen")
    assert page.evaluate("document.fullscreenElement.className") == "scene"
    button.click()
    expect(button).to_have_text("Full screen")
    assert page.evaluate("document.fullscreenElement") is None


def light(picture: bytes) -> int:
    """How many pixels of a screenshot are neither the dark ground nor its grid; without the button above it and the
    cursor that may lie over its foot."""
    pixels = cv2.imdecode(np.frombuffer(picture, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    drawn = pixels[70:340]
    return int((drawn.max(axis=2) > 110).sum())


def test_keys_are_listed_and_lead_to_pages_and_times_switch(page: Page) -> None:
    page.keyboard.press("?")
    expect(page.locator("#keys")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("#keys")).to_be_hidden()
    began = page.locator("#head time").first
    assert "UTC" in began.inner_text()
    page.keyboard.press("u")
    expect(page.locator("#status")).to_contain_text("local time")
    page.keyboard.press("u")
    expect(began).to_contain_text("UTC")
    page.keyboard.press("g")
    page.keyboard.press("e")
    expect(page.locator("h1")).to_have_text("Evidence")
    expect(page.locator("body")).to_have_attribute("data-link", "live")
    page.keyboard.press("/")
    page.keyboard.type("zebra")
    page.keyboard.press("Enter")
    expect(page.locator(".empty")).to_contain_text("None of the")
    page.locator(".empty a").click()
    expect(page.locator("body")).to_have_attribute("data-link", "live")
    page.locator("select[name=kind]").select_option("image")
    expect(page).to_have_url(re.compile(r"kind=image"))
    expect(page.locator("tbody tr")).to_have_count(8)


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1440, "light")])
def test_the_pages_fit_the_screen(
    served: Served, open_page: OpenPage, take_picture: TakePicture, console_watch: ConsoleWatch, width: int, scheme: str
) -> None:
    page = open_page(width=width, height=844, scheme=scheme)
    served.enter(page)
    one = f"/missions/{served.mission_id}"
    paths = {
        "past": f"{one}?t=60", "report": f"{one}/report", "log": f"{one}/log", "evidence": "/evidence",
        "places": "/places", "providers": "/providers", "memory": "/memory",
    }  # fmt: skip
    for name, path in paths.items():
        page.goto(served.address + path)
        wide, screen = page.locator("html").evaluate("page => [page.scrollWidth, page.clientWidth]")
        assert wide <= screen, path
        assert page.locator("h1").count() == 1
        take_picture(page, f"{name}-{scheme}-{width}")


def test_the_cursor_works_without_scripts(served: Served, open_page: OpenPage) -> None:
    page = open_page(scripts=False)
    served.enter(page)
    page.goto(served.mission + "?t=50")
    expect(page.locator("#head")).to_contain_text("as it was after event")
    page.get_by_role("link", name="back to now").click()
    expect(page.locator("#head")).to_contain_text("succeeded")
