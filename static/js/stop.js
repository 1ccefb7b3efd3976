// The stop: one press sends it at once, by the pointer or by a key, on every page; the reason may be said afterwards.
import { tr } from "./translations.js";

const panel = document.getElementById("stopped");
const title = document.getElementById("stopped-title");
const text = document.getElementById("stopped-text");
const PATIENCE_MS = 4000;
let last = "";

function key() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((one) => one.toString(16).padStart(2, "0")).join("");
}

function post(path, body, headers = {}) {
  return fetch(`/api/v1/robots${path}`, {
    method: "POST", keepalive: true, priority: "high", body: JSON.stringify(body), signal: AbortSignal.timeout(PATIENCE_MS),
    headers: { "Content-Type": "application/json", ...headers },
  });
}

function show(name, sentence) {
  title.textContent = name;
  text.textContent = sentence;
  if (panel.hidden) panel.reset();
  panel.hidden = false;
}

// Sent before anything else is done, and without a key: a stop that is repeated changes nothing, and a key would be
// written to the disk before the stop is. Where no answer comes the page's own form is sent, which needs no script.
async function stop(form) {
  const robot = form.dataset.stop, began = performance.now();
  const name = robot ? tr("Stop of {robot}", { robot }) : tr("Stop of all robots");
  last = robot;
  const sent = post(robot ? `/${robot}/stop` : "/stop", {});
  form.querySelector("button").dataset.pressed = "";
  show(name, tr("is on its way."));
  try {
    const answer = await sent;
    if (!answer.ok) throw new Error(String(answer.status));
    const ms = Math.round(performance.now() - began), told = await answer.json();
    const left = told.refused.join(" ");
    show(name, left || tr("was sent after {ms} ms. Why was it stopped?", { ms }));
  } catch {
    form.submit();
  } finally {
    delete form.querySelector("button").dataset.pressed;
  }
}

document.addEventListener("submit", (event) => {
  if (!("stop" in event.target.dataset) || event.target.dataset.plain) return;
  event.preventDefault();
  stop(event.target);
});

document.addEventListener("keydown", (event) => {
  if (!event.altKey || event.ctrlKey || event.metaKey) return;
  const wanted = event.code === "KeyS" ? "Alt+S" : `Alt+${event.code.replace(/^(Digit|Numpad)/, "")}`;
  const buttons = [...document.querySelectorAll("#bar button.stop:not([disabled])")];
  const button = buttons.find((one) => one.getAttribute("aria-keyshortcuts") === wanted)
    || (wanted === "Alt+S" && buttons.length === 1 ? buttons[0] : null);
  if (!button) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  if (!event.repeat) stop(button.form);
}, true);

panel?.addEventListener("click", (event) => {
  if (event.target.closest("[data-close]")) panel.hidden = true;
});

panel?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const reason = panel.elements.reason.value.trim();
  if (!reason) return panel.elements.reason.focus();
  panel.hidden = true;
  const robots = last ? [last] : [...document.querySelectorAll("#bar form[data-stop]")].map((one) => one.dataset.stop).filter(Boolean);
  for (const robot of robots) await post(`/${robot}/stop/reason`, { reason }, { "Idempotency-Key": key() }).catch(() => {});
});
