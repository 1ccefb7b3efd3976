"""A console left open all night: going from page to page leaves nothing behind in the browser or on the server."""

from typing import Any

from playwright.sync_api import CDPSession, Page

from tests.browser.conftest import OpenPage
from tests.builders.serving import Serving, serving
from tests.builders.timeouts import wait_until

ROUNDS = 6
REFRESH = """async (times) => { for (let n = 0; n < times; n++) {
    document.body.dispatchEvent(new CustomEvent("live:resync")); await new Promise((go) => setTimeout(go, 60)); } }"""
SLACK = 1.2
"""Heap after the rounds against heap before them."""


def heap(session: CDPSession) -> dict[str, Any]:
    """Bytes in use and nodes alive, after a collection of garbage."""
    session.send("HeapProfiler.collectGarbage")
    found = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
    return {name: found[name] for name in ("JSHeapUsedSize", "Nodes", "JSEventListeners", "Documents")}


def as_before(session: CDPSession, before: dict[str, Any], *names: str) -> bool:
    """Whether no more is kept than before; what a page still fetches is let go of in a moment, a leak never."""
    after = heap(session)
    return all(after[name] <= SLACK * before[name] for name in names)


def wander(served: Serving, page: Page) -> None:
    """Open the pages that an operator uses, one after the other."""
    for path in ("/", "/missions", f"/handoffs/{served.asked.handoff_id}", "/alerts", "/robots", "/queue"):
        served.open(page, path)


def test_navigating_leaves_heap_and_streams_as_they_were(open_page: OpenPage) -> None:
    with serving() as served:
        page = served.enter(open_page())
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable")
        wander(served, page)
        served.open(page, "/")
        before = heap(session)
        for _ in range(ROUNDS):
            wander(served, page)
        served.open(page, "/")
        wait_until(
            page, lambda: as_before(session, before, "JSHeapUsedSize", "Nodes", "JSEventListeners"), "a small heap"
        )
        wait_until(page, lambda: served.broker.watching <= 2, "an end of the streams of pages that were left")
        assert as_before(session, before, "JSHeapUsedSize", "Nodes", "JSEventListeners")
        assert served.broker.watching <= 2


def test_a_page_that_refreshes_itself_for_hours_keeps_its_size(open_page: OpenPage) -> None:
    with serving() as served:
        page = served.enter(open_page())
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable")
        requested: list[str] = []
        page.on("request", lambda request: requested.append(request.url))
        page.evaluate(REFRESH, 10)
        page.wait_for_timeout(300)
        before = heap(session)
        requested.clear()
        page.evaluate(REFRESH, 60)
        assert len(requested) >= 3, "the page did not refresh itself"
        wait_until(page, lambda: as_before(session, before, "JSHeapUsedSize", "JSEventListeners"), "a small heap")
        assert as_before(session, before, "JSHeapUsedSize", "JSEventListeners")
