"""A person watches a real mission in a browser: from the sign-in link to the report, live, in words and in 3D.

REGEN_CONSOLE_URL names a sign-in link of a console that runs already; without it, `regen up` is started here.
"""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import ConsoleWatch, OpenPage, TakePicture
from tests.builders.serving import LET_GO_EARLY, VIEWER
from tests.builders.silence import listen, silent_ms
from tests.builders.timeouts import TIMEOUT_S, wait_until

ROOT = Path(__file__).resolve().parents[2]
REPORT_MS = 300_000


class Console:
    """One running `regen up`."""

    def __init__(self, folder: Path, *options: str) -> None:
        command = [sys.executable, "-m", "app.cli.main", "up", "--data", str(folder), "--port", "0"]
        self._log = (folder.parent / "up.log").open("w+", encoding="utf-8")
        self.process = subprocess.Popen(
            [*command, "--fidelity", "kinematic", *options],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+/account/sign-in\?token=\S+", line)
        assert found, line
        self.link = found.group()
        self.address = self.link.split("/account")[0]
        self.folder = folder

    def fresh_link(self) -> str:
        """One more sign-in link, by the owner's token from the data folder."""
        owner = json.loads((self.folder / "owner.lock").read_text(encoding="utf-8"))
        headers = {"Authorization": f"Bearer {owner['token']}"}
        answer = httpx.post(f"{self.address}/api/v1/sign-in-links", headers=headers, timeout=TIMEOUT_S)
        return str(answer.raise_for_status().json()["url"])

    def suspend(self) -> None:
        self.process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self.process.send_signal(signal.SIGCONT)

    def stop(self) -> None:
        self.go_on()
        self.process.terminate()
        try:
            self.process.wait(timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(timeout=TIMEOUT_S)
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._log.close()


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Console]:
    """One console for all tests here, with an inspection under way; the physics is tried elsewhere."""
    folder = tmp_path_factory.mktemp("console")
    start = ("--start", "warehouse-inspection", "--start-now")
    running = Console(folder / "var", "--speed", "4", "--fidelity", "kinematic", *start)
    yield running
    running.stop()


@pytest.fixture
def console_url(request: pytest.FixtureRequest) -> str:
    """A sign-in link."""
    named = os.environ.get("REGEN_CONSOLE_URL")
    if named:
        return named
    running: Console = request.getfixturevalue("console")
    return running.fresh_link()


def enter(page: Page, console: Console) -> None:
    """Sign in by a fresh link and come to the overview."""
    page.goto(console.fresh_link())
    page.wait_for_url(re.compile(r"/$"))


def open_mission(page: Page) -> None:
    """From the overview to the mission that is under way."""
    page.locator("#now a.strong[href^='/missions/']").first.click()
    expect(page.locator("#stages")).to_be_visible()


def colours(picture: bytes) -> int:
    """How many different colours a screenshot has."""
    pixels = cv2.imdecode(np.frombuffer(picture, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    return len(np.unique(pixels.reshape(-1, 3), axis=0))


def niceness(pid: int) -> set[int]:
    """Of every thread of a process; those that ended meanwhile are left out."""
    found = set()
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with suppress(ProcessLookupError):
            found.add(os.getpriority(os.PRIO_PROCESS, int(thread.name)))
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="reads the threads of processes from /proc")
def test_the_console_stands_before_what_runs_beside_it_where_the_system_allows_it(console: Console) -> None:
    asked = subprocess.run(["nice", "-n", "-10", "nice"], capture_output=True, text=True, check=True)
    assert niceness(console.process.pid) == {int(asked.stdout)}
    (robot,) = console.folder.glob("robots/*/robot.json")
    (of_robot,) = niceness(json.loads(robot.read_text())["pid"])
    assert of_robot == max(0, os.getpriority(os.PRIO_PROCESS, 0))


@pytest.mark.timeout(600)
def test_a_mission_is_watched_to_its_report_without_a_reload(
    console_url: str, open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    """With an empty page for a 3D view, which would draw all the while; it is drawn at the end."""
    console_watch.expect(VIEWER)
    page = open_page(width=1440, height=900)
    page.goto(console_url)
    page.wait_for_url(re.compile(r"/$"))
    open_mission(page)
    page.locator("body").evaluate("body => { body.dataset.unreloaded = 'yes' }")
    expect(page.locator("body")).to_have_attribute("data-link", "live")
    expect(page.locator("#stage-go[data-state=committed]")).to_be_visible(timeout=REPORT_MS)
    expect(page.locator("#stage-go")).to_contain_text("distance")
    expect(page.locator("#graph .node[data-state=committed]").first).to_be_visible()
    expect(page.locator("#head")).to_contain_text("succeeded", timeout=REPORT_MS)
    expect(page.locator("#head")).to_contain_text("Goal met")
    expect(page.locator("#contract .verdict[data-verdict=satisfied]").first).to_be_visible()
    expect(page.locator("#stages .stage[data-state=committed]")).to_have_count(7)
    assert page.locator("body").get_attribute("data-unreloaded") == "yes"
    take_picture(page, "mission-succeeded")
    other = open_page(viewer=True)
    other.context.add_cookies(page.context.cookies())
    other.goto(page.url)
    other.locator(".scene").scroll_into_view_if_needed()
    expect(other.frame_locator(".scene iframe").locator("canvas").first).to_be_visible()
    other.context.close()
    page.goto(page.url.split("?")[0].split("#")[0] + "?node=panorama")
    expect(page.locator("#evidence img")).to_have_count(8)
    expect(page.locator("#evidence figcaption .verdict[data-verdict=satisfied]")).to_have_count(8)


def test_the_3d_view_draws_what_the_lidar_saw(
    console: Console, open_page: OpenPage, console_watch: ConsoleWatch, take_picture: TakePicture
) -> None:
    console_watch.expect(VIEWER)
    page = open_page(width=1280, height=900, viewer=True)
    enter(page, console)
    open_mission(page)
    expect(page.locator("#view")).to_contain_text(re.compile(r"[1-9]\d{2} points|\d \d{3} points"))
    scene = page.locator(".scene")
    scene.scroll_into_view_if_needed()
    wait_until(page, lambda: colours(scene.screenshot()) >= 60, "a 3D view that is not uniform")
    take_picture(page, "scene", whole=False)


def test_a_page_that_is_not_live_says_so_within_two_seconds_and_recovers_by_itself(
    console: Console, open_page: OpenPage, take_picture: TakePicture
) -> None:
    page = open_page()
    listen(page)
    enter(page, console)
    body = page.locator("body")
    expect(body).to_have_attribute("data-link", "live")
    page.goto(f"{console.address}/missions/new")
    start = page.get_by_role("button", name="Start", exact=True)
    expect(body).to_have_attribute("data-link", "live")
    expect(start).to_be_enabled()
    console.suspend()
    expect(body).to_have_attribute("data-link", "lost")
    assert silent_ms(page) < 2000
    expect(start).to_be_disabled()
    expect(page.locator("#status")).to_contain_text(re.compile(r"Not live since \d\d:\d\d:\d\d UTC"))
    expect(page.locator("[data-region][data-stale^='not live since']")).to_have_count(2)
    take_picture(page, "not-live")
    console.go_on()
    expect(body).to_have_attribute("data-link", "live")
    expect(start).to_be_enabled()
    expect(page.locator("[data-stale]")).to_have_count(0)


@pytest.mark.timeout(600)
def test_a_handoff_is_approved_by_holding_a_key_and_letting_go_early_changes_nothing(
    console: Console, open_page: OpenPage, take_picture: TakePicture
) -> None:
    page = open_page()
    enter(page, console)
    started = page.request.post(
        f"{console.address}/api/v1/missions",
        headers={"Origin": console.address},
        data={"robot_id": "vbot-1", "template": "circuit", "labels": {"faults": "interrupted:persistent"}},
    )
    assert started.status == 201
    first = page.request.get(f"{console.address}/api/v1/missions").json()[-1]["mission_id"]
    page.request.post(
        f"{console.address}/api/v1/missions/{first}/stop",
        headers={"Origin": console.address},
        data={"reason": "the circuit comes first"},
    )
    question = page.locator("#now .question a")
    expect(question).to_be_visible(timeout=REPORT_MS)
    question.click()
    page.get_by_role("button", name="Look again").click()
    expect(page.locator(".mono", has_text="cycle 2").first).to_be_visible()
    expect(page.locator("body")).to_have_attribute("data-link", "live")
    page.get_by_role("button", name="checked on site").click()
    approve = page.locator("#approve")
    approve.evaluate(LET_GO_EARLY)
    expect(page.locator("#status")).to_contain_text("nothing was sent")
    expect(page.locator("#decision")).to_be_visible()
    take_picture(page, "handoff")
    approve.focus()
    page.keyboard.down("Enter")
    expect(page.locator(".steps")).to_contain_text("checked on site")
    page.keyboard.up("Enter")
    expect(page.locator(".steps li", has_text="dispatched")).to_have_attribute("data-state", "done")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_no_page_is_wider_than_the_screen(
    console: Console, open_page: OpenPage, take_picture: TakePicture, width: int, scheme: str
) -> None:
    page = open_page(width=width, height=844, scheme=scheme)
    enter(page, console)
    mission = page.locator("#now a.strong[href^='/missions/']").first.get_attribute("href")
    paths = {"overview": "/", "missions": "/missions", "new": "/missions/new", "handoffs": "/handoffs"}
    for name, path in (*paths.items(), ("stop", f"{mission}/stop")):
        page.goto(console.address + path)
        wide, screen = page.locator("html").evaluate("page => [page.scrollWidth, page.clientWidth]")
        assert wide <= screen, path
        assert page.locator("h1").count() == 1
        take_picture(page, f"{name}-{scheme}-{width}")


def test_the_pages_work_without_scripts(console: Console, open_page: OpenPage) -> None:
    page = open_page(scripts=False)
    enter(page, console)
    page.goto(f"{console.address}/missions/new?template=circuit")
    page.get_by_role("button", name="Start", exact=True).click()
    expect(page.locator("h1")).to_be_visible()
    page.get_by_role("button", name="Stop vbot-1").click()
    expect(page.get_by_text("The stop of vbot-1 was sent.")).to_be_visible()
    expect(page.locator("[data-reason]").first).to_be_attached()
    expect(page.locator("[data-reason]").filter(visible=True)).to_have_count(0)
    page.get_by_role("textbox", name="Reason").fill("person in the way")
    page.get_by_role("button", name="Save the reason").click()
    expect(page).to_have_url(re.compile("/robots/vbot-1$"))
