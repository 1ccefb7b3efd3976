// Comfort: the list of keys, ways by key, UTC or local time, a call for a new question, printing, the newest line, names of columns.
import { tr } from "./translations.js";

const WAYS = { o: "/", m: "/missions", h: "/handoffs", a: "/alerts", r: "/robots", e: "/evidence", s: "/missions/new" };
const sheet = document.getElementById("keys");
const title = document.title;
let going = 0;
let waiting = questions();
let flashing = 0;

const inField = (on) => on.closest?.("input, select, textarea, [contenteditable]");
const local = () => localStorage.getItem("clock") === "local";
const called = () => localStorage.getItem("call") === "on";

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || inField(event.target) || sheet?.open) return;
  if (event.key === "?") { event.preventDefault(); sheet?.showModal(); return; }
  if (event.key === "u") { zone(); return; }
  if (event.key === "/") {
    const field = document.querySelector("input[type=search]");
    if (field) { event.preventDefault(); field.focus(); field.select(); }
    return;
  }
  if (event.key === "g") { going = performance.now(); return; }
  if (performance.now() - going < 1200 && WAYS[event.key]) location.href = WAYS[event.key];
  going = 0;
});

document.addEventListener("click", (event) => {
  if (event.target.closest?.("[data-help]")) sheet?.showModal();
  if (event.target.closest?.("[data-zone]")) zone();
  if (event.target.closest?.("[data-call]")) call();
  if (event.target.closest?.("[data-print=now]")) print();
});

// A short word in the one status line: it is read aloud, takes no focus and goes by itself.
function say(text) {
  const status = document.getElementById("status");
  if (!status) return;
  status.textContent = text;
  setTimeout(() => { if (status.textContent === text) status.textContent = ""; }, 4000);
}

function zone() {
  localStorage.setItem("clock", local() ? "utc" : "local");
  times();
  say(local() ? tr("All times are shown in local time.") : tr("All times are shown in UTC."));
}

// Every <time datetime> keeps its UTC text aside and shows local time on demand.
function times() {
  const options = { year: "numeric", month: "2-digit", day: "2-digit", hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23", timeZoneName: "short" };
  for (const one of document.querySelectorAll("time[datetime]")) {
    if (!one.dataset.utc || !one.dataset.shown || one.textContent !== one.dataset.shown) {
      if (one.textContent.includes("UTC")) one.dataset.utc = one.textContent;
    }
    if (!one.dataset.utc) continue;
    const text = local() ? new Date(one.getAttribute("datetime")).toLocaleString("sv-SE", options) : one.dataset.utc;
    if (one.textContent !== text) one.textContent = text;
    one.dataset.shown = text;
  }
}

// Off until somebody asks for it: a tone and a flashing title when one more question waits than before.
function call() {
  localStorage.setItem("call", called() ? "off" : "on");
  pressed();
  say(called() ? tr("A tone and the title will tell of a new question.") : tr("New questions come without a tone."));
  if (called()) tone();
}

function pressed() {
  for (const button of document.querySelectorAll("[data-call]")) button.setAttribute("aria-pressed", String(called()));
}

function questions() {
  return Number(document.querySelector("#rail a[href='/handoffs'] .count")?.firstChild?.textContent || 0);
}

function noticed() {
  const now = questions();
  if (now > waiting && called()) { tone(); flash(); }
  waiting = now;
}

function tone() {
  const sound = new AudioContext();
  const wave = new OscillatorNode(sound, { frequency: 660 });
  const volume = new GainNode(sound, { gain: 0.08 });
  wave.connect(volume).connect(sound.destination);
  wave.onended = () => sound.close();
  wave.start();
  wave.stop(sound.currentTime + 0.35);
}

function flash() {
  clearInterval(flashing);
  let left = 20;
  flashing = setInterval(() => {
    left -= 1;
    document.title = left % 2 ? tr("A question waits") : title;
    if (left <= 0 || !questions()) { clearInterval(flashing); document.title = title; }
  }, 700);
}

// The list of events shows the one that the reader stands at, or the newest, without moving the page.
function inView() {
  const box = document.querySelector("#events .scroll");
  if (!box) return;
  const row = box.querySelector("tr[aria-current]") || (document.body.dataset.instant !== "past" ? box.querySelector("tbody tr:last-child") : null);
  if (row) box.scrollTop = row.offsetTop - box.clientHeight / 2;
}

// On a phone a row of a list stands on end: every cell then says which column it is of.
function columns() {
  for (const table of document.querySelectorAll(".list, .stacked")) {
    const names = [...table.querySelectorAll("thead th")].map((one) => one.textContent.trim());
    for (const cell of table.querySelectorAll("tbody td")) if (names[cell.cellIndex]) cell.dataset.column = names[cell.cellIndex];
  }
}

document.addEventListener("htmx:after:swap", () => { if (local()) times(); noticed(); inView(); columns(); });
times();
columns();
pressed();
inView();
