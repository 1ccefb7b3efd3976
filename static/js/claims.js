// Whoever has claimed a question keeps it as long as the page is open: renewed well before the minute is over.
const EVERY_MS = 20000;

async function renew() {
  const form = document.querySelector("form[data-keep]");
  if (!form || document.body.dataset.link === "lost") return;
  try {
    await fetch(form.action, { method: "POST", body: new URLSearchParams(new FormData(form)), redirect: "manual" });
  } catch {
    return; // A lost link shows itself in the bar; the claim then lapses by itself.
  }
}

setInterval(renew, EVERY_MS);
