"""A goal that is spoken into the browser's own microphone: Chromium plays a recording into it, as a person speaks."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

import pytest
import uvicorn
from playwright.sync_api import Page, Playwright, expect
from pydantic import SecretStr

from app.main import bind
from app.settings import ConsoleSettings
from harness.contracts.ids import MissionId
from tests.browser.conftest import VIOLATIONS, empty_viewer
from tests.builders.consoles import Stand, console_stand
from tests.builders.timeouts import TIMEOUT_MS, TIMEOUT_S
from tests.integration.test_speaking import LASTS_S, paper_recording
from tools import browser as chromium


@dataclass(frozen=True)
class Speaking:
    """A console and a page of a browser that hears the paper's recording in its microphone again and again."""

    stand: Stand
    page: Page


@pytest.fixture
def speaking(playwright: Playwright, tmp_path: Path) -> Iterator[Speaking]:
    sound = tmp_path / "microphone.wav"
    sound.write_bytes(paper_recording())
    listener = bind(0)
    port = listener.getsockname()[1]
    settings = ConsoleSettings(port=port, robots=("vbot-1",), owner_token=SecretStr("t"), password_memory_kib=19456)
    executable = chromium.find(playwright)
    flags = (
        "--use-fake-ui-for-media-stream",
        "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-audio-capture={sound}",
    )
    with console_stand(settings=settings) as stand:
        server = uvicorn.Server(uvicorn.Config(stand.app, log_level="warning", timeout_graceful_shutdown=1))
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        browser = playwright.chromium.launch(
            executable_path=executable, headless=True, args=[*chromium.FLAGS_2D, *flags]
        )
        page = browser.new_page()
        page.set_default_timeout(TIMEOUT_MS)
        page.add_init_script(VIOLATIONS)
        empty_viewer(page)
        page.goto(f"http://127.0.0.1:{port}{stand.app.state.sessions.invite()}")
        page.wait_for_url(re.compile(r"/$"))
        yield Speaking(stand, page)
        browser.close()
        server.should_exit = True
        thread.join(timeout=TIMEOUT_S)
        listener.close()


@pytest.mark.ledger("R197", entry="page", symbol="app.routes.missions:spoken_form")
def test_what_is_spoken_into_the_microphone_starts_the_inspection(speaking: Speaking) -> None:
    page, errors = speaking.page, []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(re.sub(r"(https?://[^/]+).*", r"\1/missions/new", page.url))
    page.get_by_role("button", name="Turn on the microphone").click()
    hold = page.get_by_role("button", name="Hold to talk")
    expect(hold).to_be_enabled()
    hold.hover()
    page.mouse.down()
    page.wait_for_timeout(LASTS_S * 1000 + 600)
    page.mouse.up()
    expect(page.locator("#reading")).to_contain_text("check the office storage area")
    expect(page.locator("#reading")).to_contain_text("inspect Office storage area")
    assert speaking.stand.harness.runtime.missions() == [], "nothing starts before it is confirmed"
    page.get_by_role("button", name="Confirm this reading and start").click()
    page.wait_for_url("**/missions/msn_*")
    mission_id = MissionId(page.url.rpartition("/")[2])
    capture = speaking.stand.harness.runtime.mission(mission_id).spoken.capture  # type: ignore[union-attr]
    assert 0.0 < capture.recording_s - capture.acquired_s < 60.0  # type: ignore[union-attr, operator]
    expect(page.get_by_text("The microphone gave its first samples")).to_be_visible()
    done = speaking.stand.harness.supervisor.run(mission_id)
    assert done.status == "succeeded" and done.template == "warehouse-inspection"
    page.goto(f"{page.url}/report")
    sound = page.locator("audio[data-played]")
    expect(sound).to_have_count(1)
    assert [one for one in errors if "422" not in one] == []
    sound.evaluate("one => { one.playbackRate = 16; return one.play(); }")
    expect(page.get_by_text("Played in this browser to its end")).to_be_visible()
