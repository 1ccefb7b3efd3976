"""Defines how long tests wait for an expected event: far longer than a busy machine needs, so that only a hang
reaches it.
"""

import time
from collections.abc import Callable

from playwright.sync_api import Page

TIMEOUT_S = 60.0
TIMEOUT_MS = 60_000
LOOK_MS = 50


def wait_until(page: Page, true: Callable[[], bool], what: str) -> None:
    """Let the page run until a condition holds that the page does not show by itself."""
    until_s = time.monotonic() + TIMEOUT_S
    while not true():
        assert time.monotonic() < until_s, f"{what} did not come true within {TIMEOUT_S:.0f} s"
        page.wait_for_timeout(LOOK_MS)
