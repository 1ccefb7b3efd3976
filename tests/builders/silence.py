"""Measures how long a page takes to report a lost link: from the last message that reached it to its report, by
its clock.
"""

from playwright.sync_api import Page

from tests.builders.timeouts import wait_until

LISTENING = """
window.EventSource = class extends EventSource {
    constructor(...given) {
        super(...given);
        for (const name of ["hello", "changed", "beat", "joined"]) this.addEventListener(name, heard);
    }
};
let last = performance.now(), late = 0;
function slept() { const now = performance.now(); late += Math.max(0, now - last - 50); last = now; }
function heard() { window.heardAt = last = performance.now(); late = 0; }
setInterval(slept, 50);
addEventListener("DOMContentLoaded", () => new MutationObserver(() => {
    if (document.body.dataset.link !== "lost" || !window.heardAt || window.silentMs !== undefined) return;
    slept();
    window.silentMs = performance.now() - window.heardAt - late;
}).observe(document.body, { attributes: true }));
"""
"""Notes when the page heard something, when it said that the link is lost, and for how long it got no turn between."""


def listen(page: Page) -> None:
    """Measure from the next page that is opened here."""
    page.add_init_script(LISTENING)


def silent_ms(page: Page) -> float:
    """From the console's last message to "lost", less the time for which the machine kept the page waiting."""
    wait_until(page, lambda: page.evaluate("window.silentMs !== undefined"), "a word about the lost link")
    found: float = page.evaluate("window.silentMs")
    return found
