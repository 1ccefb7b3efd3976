"""Walks through pages as a person does, counting clicks and seconds, and takes a picture after every step."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from playwright.sync_api import Locator, Page, Request, TimeoutError, expect

PATIENCE_MS = 600_000.0
"""How long a page or a robot may take; what a step really took is what is published."""
PRESSES, PRESS_MS = 6, 30_000.0
"""A button rests while the page is not live: a person presses it again."""


@dataclass
class JourneyStep:
    """One thing that a person wants to do: its clicks, the seconds until it was done, and the picture after it."""

    name: str
    clicks: int = 0
    seconds: float = 0.0
    picture: str = ""


@dataclass
class JourneyWalk:
    """One person's way. Typing counts no click; holding a button counts as one."""

    page: Page
    journey: str
    pictures: Path
    patience_ms: float = PATIENCE_MS
    steps: list[JourneyStep] = field(default_factory=list)

    @contextmanager
    def step(self, name: str) -> Iterator[JourneyStep]:
        """Count what is done in this block; a picture is taken at its end, also where it failed."""
        step = JourneyStep(name)
        self.steps.append(step)
        began_s = time.monotonic()
        try:
            yield step
        finally:
            step.seconds = round(time.monotonic() - began_s, 1)
            path = self.pictures / f"{self.journey}-{len(self.steps):02}.png"
            self.page.screenshot(path=path)
            step.picture = path.name

    def enter(self, link: str) -> None:
        """Open the one-time link and arrive on the first page: one click in a terminal."""
        self.steps[-1].clicks += 1
        self.page.goto(link)
        self.page.wait_for_url(re.compile(r"/$"))

    def click(self, target: Locator) -> None:
        """One click, once the target is there and nothing lies over it."""
        self.steps[-1].clicks += 1
        target.click()

    def follow(self, name: str) -> None:
        """Click on the first link of this name."""
        self.click(self.page.get_by_role("link", name=name).first)

    def press(self, name: str) -> None:
        """Click on the first button of this name in the page itself."""
        self.click(self.page.locator("main").get_by_role("button", name=name).first)

    def section(self, name: str) -> None:
        """Click on a page of the rail."""
        self.click(self.page.locator(".rail").get_by_role("link", name=name))

    def hold(self, target: Locator, ready: Callable[[], None] = lambda: None) -> None:
        """Press and hold until the page is sent; again where the press met a button that rested for a moment.

        `ready` is done before each press.
        """
        for _ in range(PRESSES):
            ready()
            self.steps[-1].clicks += 1
            target.scroll_into_view_if_needed()
            expect(target).to_be_enabled()
            target.hover()
            try:
                with self.page.expect_request(_sent, timeout=PRESS_MS):
                    self.page.mouse.down()
                return
            except TimeoutError:
                continue
            finally:
                self.page.mouse.up()
        raise AssertionError(f"{PRESSES} times the page was not sent")


def _sent(request: Request) -> bool:
    return request.method == "POST" and request.is_navigation_request()
