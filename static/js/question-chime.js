// A tone and a flashing title for a new question, for whoever asked for it.
import { say } from "./announce.js";
import { tr } from "./translations.js";

const title = document.title;
let waiting = questions();
let flashing = 0;

const called = () => localStorage.getItem("call") === "on";

document.addEventListener("click", (event) => { if (event.target.closest?.("[data-call]")) call(); });

// Off until somebody asks for it: a tone and a flashing title when one more question waits than before.
function call() {
  localStorage.setItem("call", called() ? "off" : "on");
  pressed();
  say(called() ? tr("A chime and the page title will announce a new handoff.") : tr("New handoffs come without a tone."));
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
    document.title = left % 2 ? tr("A handoff waits") : title;
    if (left <= 0 || !questions()) { clearInterval(flashing); document.title = title; }
  }, 700);
}

document.addEventListener("htmx:after:swap", noticed);
pressed();
