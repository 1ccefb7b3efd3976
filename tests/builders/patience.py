"""Defines how long tests wait for an expected event: far longer than a busy machine needs, so that only a hang
reaches it.
"""

import time
from collections.abc import Callable

from playwright.sync_api import Page

PATIENCE_S = 60.0
PATIENCE_MS = 60_000
LOOK_MS = 50


def comes_true(page: Page, true: Callable[[], bool], what: str) -> None:
    """Let the page run until a condition holds that the page does not show by itself."""
    until_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < until_s, f"{what} did not come true within {PATIENCE_S:.0f} s"
        page.wait_for_timeout(LOOK_MS)
