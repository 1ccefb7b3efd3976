// Times that go on by themselves, by the server's clock: the clock in the bar, deadlines, ages.
import { tr } from "./translations.js";

const offset = Number(document.body.dataset.now) - Date.now() / 1000;
const now = () => Date.now() / 1000 + offset;

function span(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  const minutes = Math.floor(whole / 60);
  const fields = { minutes, seconds: whole % 60 };
  return minutes ? tr("{minutes} min {seconds} s", fields) : tr("{seconds} s", fields);
}

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function tick() {
  const at = now();
  for (const one of document.querySelectorAll("[data-clock]")) {
    if (document.body.dataset.link !== "lost") write(one, new Date(at * 1000).toISOString().slice(11, 19) + " UTC");
  }
  for (const one of document.querySelectorAll("[data-countdown]")) {
    const left = Number(one.dataset.countdown) - at;
    write(one, left > 0 ? tr("{time} left", { time: span(left) }) : tr("the time is over"));
  }
  for (const one of document.querySelectorAll("time[data-since]")) write(one, span(at - Number(one.dataset.since)));
  for (const one of document.querySelectorAll("[data-fresh-until]")) {
    const old = Number(one.dataset.freshUntil) < at;
    if (!old || one.disabled) continue;
    one.disabled = one.hidden = true;
    one.form.querySelector("[data-instead]").hidden = false;
  }
}

tick();
setInterval(tick, 250);
