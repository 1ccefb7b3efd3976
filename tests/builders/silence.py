"""How long a page says nothing of a lost link: from the last word that reached it to its own, by its own clock."""

from playwright.sync_api import Page

from tests.builders.patience import comes_true

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
    """From the next page on that is opened here."""
    page.add_init_script(LISTENING)


def silent_ms(page: Page) -> float:
    """Between the last word from the console and "lost", less what the machine kept the page waiting for its turn."""
    comes_true(page, lambda: page.evaluate("window.silentMs !== undefined"), "a word about the lost link")
    found: float = page.evaluate("window.silentMs")
    return found
