// One EventSource per page. It carries names; the regions fetch themselves. A page that is not live says so.
import { tr } from "./translations.js";

const LOST_AFTER_MS = 1600;
const OPENS_WITHIN_MS = 8000;
const FIRST_MS = 100;
const body = document.body;
const topics = (body.dataset.topics || "").split(" ").filter(Boolean);
const exact = { mission: "live:mission", live: "live:observations", handoff: "live:handoff", alert: "live:alert", candidate: "live:candidate" };
const families = { mission: "live:missions", handoff: "live:handoffs", alert: "live:alerts", candidate: "live:candidates", release: "live:releases", control: "live:control", fleet: "live:fleet", shadow: "live:shadow", lease: "live:control" };
let position = body.dataset.position;
let heard = performance.now();
let source = null;
let waiting = new Set();
let asked = -Infinity;
let signalled = 0;
let losses = 0;
let together = 0;
const lag = document.getElementById("lag");
const drops = document.getElementById("drops");

function tell(name) {
  body.dispatchEvent(new CustomEvent(name));
}

function say(text) {
  const status = document.getElementById("status");
  if (status && status.textContent !== text) status.textContent = text;
}

function buttons(off) {
  for (const button of document.querySelectorAll("form[data-act] button")) {
    if (off && !button.disabled) { button.disabled = true; button.dataset.off = ""; }
    else if (!off && "off" in button.dataset) { button.disabled = false; delete button.dataset.off; }
  }
}

function lost() {
  if (body.dataset.link === "lost") return;
  if (body.dataset.link === "opening" && performance.now() < OPENS_WITHIN_MS) return;
  const since = new Date(Date.now() - (performance.now() - heard)).toISOString().slice(11, 19);
  body.dataset.link = "lost";
  for (const region of document.querySelectorAll("[data-region]")) region.dataset.stale = tr("not live since {time} UTC", { time: since });
  buttons(true);
  say(tr("Not live since {time} UTC. What you see may be old. Stop still works if the console answers.", { time: since }));
  losses += 1;
  counted();
}

// Heard again after a silence: every region is fetched anew before the page calls itself live.
function alive() {
  heard = performance.now();
  if (body.dataset.link === "lost" && heard - asked > 3000) resync();
}

function resync() {
  asked = performance.now();
  waiting = new Set([...document.querySelectorAll("[data-region]")].map((region) => region.id));
  tell("live:resync");
  if (!waiting.size) live();
}

function live() {
  for (const region of document.querySelectorAll("[data-stale]")) delete region.dataset.stale;
  const back = body.dataset.link === "lost";
  body.dataset.link = "live";
  buttons(false);
  say(back ? tr("Live again.") : "");
  if (back) setTimeout(() => body.dataset.link === "live" && say(""), 4000);
}

function hello(event) {
  heard = performance.now();
  const first = body.dataset.link === "opening";
  if (first && event.data === position) live();
  else resync();
  position = event.data;
}

// How long the page needed from the last signal to the changed region; said in the foot, read aloud by nobody.
function shown() {
  if (!signalled || !lag) return;
  const ms = Math.round(performance.now() - signalled);
  signalled = 0;
  lag.textContent = ms < 1000 ? tr("changes shown after {ms} ms", { ms }) : tr("changes shown after {seconds} s: this page lags", { seconds: (ms / 1000).toFixed(1) });
  lag.dataset.late = ms < 1000 ? "no" : "yes";
}

// What was told together with an earlier change, and how often the link was lost: everything was read again each time.
function counted(event) {
  if (event) { alive(); together = Number(event.data); }
  const said = [together && tr("merged updates: {count}", { count: together }), losses && tr("reconnects: {count}", { count: losses })];
  if (drops) drops.textContent = said.filter(Boolean).join(" · ");
}

// What a page is about comes first; the counts of bar and rail follow, so that a hundred pages do not ask for all at once.
function changed(event) {
  alive();
  signalled ||= performance.now();
  const name = event.data;
  const family = name.split("/", 1)[0];
  const own = topics.includes(name) && exact[family];
  if (own) tell(own);
  if (families[family]) setTimeout(tell, own ? FIRST_MS : 0, families[family]);
}

function open() {
  if (source) source.close();
  source = new EventSource("/live?" + topics.map((topic) => "topic=" + encodeURIComponent(topic)).join("&"));
  source.addEventListener("hello", hello);
  source.addEventListener("changed", changed);
  source.addEventListener("beat", alive);
  source.addEventListener("joined", counted);
  source.onerror = () => { if (source.readyState === EventSource.CLOSED) { lost(); setTimeout(open, 1000); } };
}

document.addEventListener("htmx:after:swap", () => {
  shown();
  if (body.dataset.link !== "live") for (const region of document.querySelectorAll("[data-region]:not([data-stale])")) waiting.delete(region.id);
  if (body.dataset.link !== "live" && !waiting.size && performance.now() - heard < LOST_AFTER_MS) live();
});

setInterval(() => {
  if (performance.now() - heard > LOST_AFTER_MS) lost();
}, 100);

addEventListener("pagehide", () => source && source.close());
addEventListener("pageshow", (event) => { if (event.persisted) { heard = performance.now(); open(); } });
open();
