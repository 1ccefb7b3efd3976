"""The paper's whole chain in one console: spoken, inspected, described, delivered to DingTalk, spoken back, shown.

`regen up` runs as people run it, a Chromium hears the paper's recording in its microphone, and the DingTalk group is a
local service that speaks its protocol.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from playwright.sync_api import Page, expect, sync_playwright

from harness.baseline import load
from tests.builders.timeouts import TIMEOUT_MS, TIMEOUT_S
from tests.fakes.channel_services import APP_KEY, APP_SECRET, CONVERSATION, ROBOT_CODE, DingTalkService, dingtalk
from tests.integration.test_speaking import LASTS_S, paper_recording
from tools import browser as chromium

MISSION_S = 500.0
"""The inspection takes 70 s of a quiet machine at four times real time."""


@dataclass(frozen=True)
class Chain:
    """One console at an address, a signed-in page whose browser hears the recording, and the DingTalk group."""

    address: str
    page: Page
    group: DingTalkService


def site_of(folder: Path, group: DingTalkService) -> Path:
    """The shipped site; what no goal addresses goes to the DingTalk group."""
    site = folder / "site"
    shutil.copytree(Path(load.__file__).with_name("site"), site)
    channel = {
        "kind": "dingtalk-app",
        "name": "operations",
        "address": group.address,
        "media_address": group.address,
        "app_key": {"environment": "DING_KEY"},
        "app_secret": {"environment": "DING_APP"},
        "robot_code": ROBOT_CODE,
        "conversation": CONVERSATION,
    }
    (site / "channels.yaml").write_text(yaml.safe_dump({"channels": [channel], "default": "operations"}))
    return site


@pytest.fixture
def chain(tmp_path: Path, peers: Path) -> Iterator[Chain]:
    if not (peers / "vision" / "installed").exists():
        pytest.skip("the peer vision is not installed: tools/peers.sh")
    sound = tmp_path / "microphone.wav"
    sound.write_bytes(paper_recording())
    flags = (
        "--use-fake-ui-for-media-stream",
        "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-audio-capture={sound}",
    )
    secrets = {"DING_KEY": APP_KEY, "DING_APP": APP_SECRET, "REGEN_VISION_FOLDER": str(peers / "vision")}
    with dingtalk() as group, sync_playwright() as driver:
        command = [sys.executable, "-m", "app.cli.main", "up", "--data", tmp_path / "data", "--port", "0"]
        command += ["--site", site_of(tmp_path, group), "--fidelity", "kinematic", "--speed", "4"]
        with (tmp_path / "up.log").open("w") as log:
            console = subprocess.Popen(
                [str(word) for word in command],
                env={**os.environ, **secrets},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        assert console.stdout is not None
        found = re.search(r"http://\S+/account/sign-in\?token=\S+", console.stdout.readline())
        assert found, (tmp_path / "up.log").read_text()
        executable = chromium.find(driver)
        browser = driver.chromium.launch(executable_path=executable, args=[*chromium.FLAGS_2D, *flags])
        page = browser.new_page()
        page.set_default_timeout(TIMEOUT_MS)
        expect.set_options(timeout=TIMEOUT_MS)
        page.route("**/scene/*/", lambda route: route.fulfill(content_type="text/html", body="<title>3D</title>"))
        page.goto(found.group())
        try:
            yield Chain(found.group().partition("/account")[0], page, group)
        finally:
            browser.close()
            console.terminate()
            console.wait(timeout=TIMEOUT_S)
            console.stdout.close()


def spoken(page: Page, address: str) -> str:
    """Speak the goal, read it back, confirm it; the mission's address."""
    page.goto(f"{address}/missions/new")
    page.get_by_role("button", name="Turn on the microphone").click()
    hold = page.get_by_role("button", name="Hold to talk")
    expect(hold).to_be_enabled()
    hold.hover()
    page.mouse.down()
    page.wait_for_timeout(LASTS_S * 1000 + 600)
    page.mouse.up()
    expect(page.locator("#reading")).to_contain_text("inspect Office storage area")
    page.get_by_role("button", name="Confirm this reading and start").click()
    page.wait_for_url("**/missions/msn_*")
    return page.url


def ended(page: Page, mission: str) -> dict[str, Any]:
    """The report's JSON once nothing runs any more."""
    until_s = time.monotonic() + MISSION_S
    while True:
        outcome: dict[str, Any] = json.loads(page.request.get(f"{mission}/report.json").text())
        if outcome["status"] in ("partly_verified", "succeeded", "failed", "awaiting_human"):
            return outcome
        assert time.monotonic() < until_s, outcome["status"]
        page.wait_for_timeout(1000)


def test_a_spoken_wish_is_inspected_described_delivered_and_spoken_back(chain: Chain) -> None:
    page = chain.page
    mission = spoken(page, chain.address)
    outcome = ended(page, mission)
    assert outcome["status"] == "partly_verified", "DingTalk gives no text back: the delivery is declared"
    assert {one["condition_id"] for one in outcome["declared_conditions"]} >= {"goal.delivered"}
    texts = [one["text"] for one in chain.group.messages if "text" in one]
    pictures = [one["picture"] for one in chain.group.messages if "picture" in one]
    assert len(texts) == 1 and "obstructed" in texts[0] and len(pictures) == 4

    page.goto(f"{mission}/report")
    expect(page.locator(".finding").first).to_contain_text("obstructed")
    expect(page.get_by_text("The microphone gave its first samples")).to_be_visible()
    assert page.locator("audio").count() >= 3, "the wish, the report as it was made, and as the room recorded it"
    expect(page.locator("svg.boxes").first).to_be_attached()
    expect(page.get_by_text("declared by the channel alone").first).to_be_visible()
    expect(page.get_by_text("query=SUCCESS").first).to_be_visible()
