// Driving by hand: a velocity is sent again and again as long as a key or a button is held, and zero when it is let go.
import { tr } from "./translations.js";

const EVERY_MS = 100;
const pad = document.querySelector(".pad");
if (pad) begin(pad);

function begin(pad) {
  const word = pad.querySelector(".pad-word");
  let held = null;
  let timer = 0;
  let busy = false;
  let later = [];

  function say(text) { if (word.textContent !== text) word.textContent = text; }

  async function send(v, w, again) {
    if (busy && again) return;
    busy = true;
    try {
      const answer = await fetch(pad.dataset.drive, {
        method: "POST", keepalive: true, headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ session: pad.dataset.session, v_mps: v, w_radps: w }), signal: AbortSignal.timeout(1500),
      });
      if (!answer.ok) { halt(tr("The robot does not accept the command: take control again.")); pad.querySelector("[data-again]").hidden = false; return; }
      const report = await answer.json();
      if (!held && again) return;
      say(report.reason || (report.status === "driving" ? tr("driving, {speed} m/s", { speed: report.v_mps.toFixed(2) }) : report.status));
    } catch {
      halt(tr("The link is lost: the robot stops by itself."));
    } finally { busy = false; }
  }

  function hold(button) {
    if (held === button) return;
    if (document.body.dataset.link === "lost") { say(tr("Not live: nothing is sent.")); return; }
    held = button;
    button.dataset.held = "";
    clearInterval(timer);
    const order = () => document.body.dataset.link === "lost" ? halt(tr("The link is lost: the robot stops by itself.")) : send(Number(button.dataset.v), Number(button.dataset.w), true);
    order();
    timer = setInterval(order, EVERY_MS);
  }

  function halt(text) {
    clearInterval(timer);
    if (held) delete held.dataset.held;
    held = null;
    if (text) say(text);
  }

  function release() {
    if (!held) return;
    halt(tr("stopping"));
    send(0, 0, false);
    later = [700, 1500].map((wait) => setTimeout(() => held || send(0, 0, false), wait));
  }

  pad.addEventListener("submit", () => { halt(""); for (const one of later) clearTimeout(one); });
  pad.addEventListener("pointerdown", (event) => {
    const button = event.target.closest("button[data-v]");
    if (!button || event.button !== 0) return;
    event.preventDefault();
    button.focus();
    hold(button);
  });
  for (const name of ["pointerup", "pointercancel", "blur", "pagehide"]) addEventListener(name, release);
  document.addEventListener("visibilitychange", () => document.hidden && release());
  document.addEventListener("contextmenu", (event) => event.target.closest(".pad") && event.preventDefault());
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input, select, textarea");
    const own = event.key === " " && event.target.closest?.("form button, a");
    const button = typing || own || event.ctrlKey || event.metaKey || event.altKey ? null : [...pad.querySelectorAll("button[data-key]")].find((one) => one.dataset.key === event.key);
    if (button) { event.preventDefault(); if (!event.repeat) hold(button); }
  });
  document.addEventListener("keyup", (event) => { if (held?.dataset.key === event.key) { event.preventDefault(); release(); } });
}
