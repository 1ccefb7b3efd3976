"""A Chromium for the console's pages, and a watch that fails a test on errors nobody expected."""

import base64
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Error, Page, Playwright, expect, sync_playwright

from tests.builders.timeouts import TIMEOUT_MS
from tools import browser as chromium

ARTEFACTS = Path(__file__).resolve().parents[2] / "artefacts"
NO_VIEWER = "<!doctype html><title>3D</title>"
VIOLATIONS = """addEventListener("securitypolicyviolation", e =>
    console.error("policy violation: " + e.violatedDirective + " " + e.blockedURI))"""


SELDOM_DRAWN = """(() => {
    const drawn = requestAnimationFrame;
    window.requestAnimationFrame = (draw) => setTimeout(() => drawn(draw), 250);
    window.cancelAnimationFrame = clearTimeout;
})()"""
"""The 3D view is drawn four times a second: sixty times take all processors, and show the same."""


class ConsoleWatch:
    """Errors of all pages of one test: console errors, uncaught exceptions, violations of the page's policy."""

    def __init__(self) -> None:
        self.errors: list[str] = []
        self._expected: list[re.Pattern[str]] = []

    def follow(self, page: Page) -> None:
        """Listen to one page from now on."""
        page.add_init_script(VIOLATIONS)
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.errors.append(f"uncaught: {error}"))

    def expect(self, pattern: str) -> None:
        """Errors that match are part of what the test does, as when it kills the server."""
        self._expected.append(re.compile(pattern))

    def unexpected(self) -> list[str]:
        """Errors that no expectation covers."""
        return [error for error in self.errors if not any(known.search(error) for known in self._expected)]

    def _said(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(f"{message.text} ({message.location.get('url', '')})")


class OpenPage(Protocol):
    """Opens one more page: width and height in CSS pixels, scheme light or dark, scripts on or off.

    Without `viewer` an empty page stands in the place of the 3D view: drawing it without a GPU takes all processors.
    """

    def __call__(
        self,
        url: str = "about:blank",
        *,
        width: int = 1280,
        height: int = 800,
        scheme: str = "light",
        scripts: bool = True,
        viewer: bool = False,
    ) -> Page: ...


class TakePicture(Protocol):
    """Writes artefacts/<name>.png of the whole page, or of what is in view."""

    def __call__(self, page: Page, name: str, *, whole: bool = True) -> None: ...


@pytest.fixture(scope="package")
def playwright() -> Iterator[Playwright]:
    """The driver. What is expected of a page is waited for with patience."""
    expect.set_options(timeout=TIMEOUT_MS)
    with sync_playwright() as driver:
        yield driver


@pytest.fixture(scope="package")
def browser(playwright: Playwright) -> Iterator[Browser]:
    """The Chromium that `make test` found or installed, for pages without 3D."""
    yield from _launched(playwright, chromium.FLAGS_2D)


@pytest.fixture(scope="package")
def browser_3d(playwright: Playwright) -> Iterator[Browser]:
    """The same Chromium with software rendering for 3D."""
    yield from _launched(playwright, chromium.FLAGS_3D)


@pytest.fixture
def console_watch() -> Iterator[ConsoleWatch]:
    """Fails the test at its end if a page reported something that was not expected."""
    watch = ConsoleWatch()
    yield watch
    if watch.unexpected():
        pytest.fail("The browser reported:\n  " + "\n  ".join(watch.unexpected()), pytrace=False)


@pytest.fixture
def open_page(request: pytest.FixtureRequest, console_watch: ConsoleWatch) -> Iterator[OpenPage]:
    """Opens watched pages, each in a context of its own, and closes them after the test."""
    contexts = []

    def open_one(
        url: str = "about:blank",
        *,
        width: int = 1280,
        height: int = 800,
        scheme: str = "light",
        scripts: bool = True,
        viewer: bool = False,
    ) -> Page:
        running: Browser = request.getfixturevalue("browser_3d" if viewer else "browser")
        context = running.new_context(
            viewport={"width": width, "height": height},
            color_scheme="dark" if scheme == "dark" else "light",
            java_script_enabled=scripts,
        )
        contexts.append(context)
        page = context.new_page()
        if viewer:
            page.add_init_script(SELDOM_DRAWN)
        else:
            empty_viewer(page)
        page.set_default_timeout(TIMEOUT_MS)
        console_watch.follow(page)
        page.goto(url)
        return page

    yield open_one
    for context in contexts:
        context.close()


@pytest.fixture
def browser_page(open_page: OpenPage) -> Page:
    """One watched page, 1280 x 800, light."""
    return open_page()


@pytest.fixture
def take_picture() -> TakePicture:
    """Pictures for people to look at, who ask for them with REGEN_PICTURES=1."""
    wanted = os.environ.get("REGEN_PICTURES") == "1"

    def take(page: Page, name: str, *, whole: bool = True) -> None:
        if wanted:
            ARTEFACTS.mkdir(exist_ok=True)
            page.screenshot(path=ARTEFACTS / f"{name}.png", full_page=whole)

    return take


def empty_viewer(page: Page) -> None:
    """Put an empty page in the place of the 3D view. The browser holds its address alone: `page.route` would have it
    hold every request, and keep nothing that it fetched before.
    """
    session = page.context.new_cdp_session(page)

    def answer(pause: dict[str, Any]) -> None:
        body = base64.b64encode(NO_VIEWER.encode()).decode()
        kind = [{"name": "Content-Type", "value": "text/html"}]
        whole = {"requestId": pause["requestId"], "responseCode": 200, "responseHeaders": kind, "body": body}
        with suppress(Error):  # the page was left meanwhile
            session.send("Fetch.fulfillRequest", whole)

    session.on("Fetch.requestPaused", answer)
    session.send("Fetch.enable", {"patterns": [{"urlPattern": "*/scene/*/"}]})


def _launched(playwright: Playwright, flags: Sequence[str]) -> Iterator[Browser]:
    executable = chromium.find(playwright)
    if executable is None:
        pytest.fail("No Chromium works here: run `make install-test`, or set REGEN_CHROMIUM", pytrace=False)
    running = playwright.chromium.launch(executable_path=executable, headless=True, args=list(flags))
    yield running
    running.close()
