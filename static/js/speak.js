// Push-to-talk: the microphone is turned on first, and a recording lasts as long as the button is held. Two instants are
// kept apart: the first samples of the microphone, and the first of the recording. Without scripts a file does.
import { tr } from "./translations.js";

const RATE_HZ = 16000, LONGEST_S = 29, CHUNK = 8000;
const panel = document.querySelector("[data-speak]");
const form = document.getElementById("start-form");
const on = panel?.querySelector("[data-microphone]");
const hold = panel?.querySelector("[data-hold-to-talk]");
const note = panel?.querySelector("[role=status]");
let context = null, acquired = null, recording = null, stream = null, posted = Promise.resolve();

const now = () => (performance.timeOrigin + performance.now()) / 1000;
const say = (text) => { note.textContent = text; };
const field = (name) => form.elements.namedItem(name);

async function acquire() {
  on.disabled = true;
  say(tr("Waiting for the microphone."));
  try {
    const media = await navigator.mediaDevices.getUserMedia({
      audio: { channelCount: 1, echoCancellation: false, noiseSuppression: false, autoGainControl: false },
    });
    context = new AudioContext({ sampleRate: RATE_HZ });
    await context.audioWorklet.addModule(panel.dataset.worklet);
    const node = new AudioWorkletNode(context, "samples", { numberOfOutputs: 0 });
    node.port.onmessage = (event) => taken(event.data);
    context.createMediaStreamSource(media).connect(node);
  } catch {
    on.disabled = false;
    say(tr("The microphone cannot be used here. Choose a file instead."));
  }
}

function taken(samples) {
  if (acquired === null) {
    acquired = now() - samples.length / RATE_HZ;
    hold.disabled = false;
    say(tr("The microphone is on. Hold the button and speak."));
  }
  if (!recording) return;
  if (recording.began === null) recording.began = now() - samples.length / RATE_HZ;
  recording.parts.push(samples);
  recording.length += samples.length;
  if (recording.length - recording.sent >= CHUNK) follow();
  if (recording.length >= LONGEST_S * RATE_HZ) end();
}

function begin(event) {
  if (recording || acquired === null || event.repeat) return;
  event.preventDefault();
  recording = { parts: [], length: 0, sent: 0, began: null };
  hold.setAttribute("aria-pressed", "true");
  say(tr("Recording. Let go to end it."));
  stream = null;
  posted = fetch("/api/v1/speech", { method: "POST" })
    .then((answer) => (answer.ok ? answer.json() : null))
    .then((opened) => { stream = opened?.stream ?? null; })
    .catch(() => { stream = null; });
}

// What was heard so far is shown while somebody speaks; it decides nothing, and a failure costs only that.
function follow() {
  const body = pcm(recording.parts, recording.length).slice(recording.sent * 2);
  recording.sent = recording.length;
  posted = posted.then(async () => {
    if (!stream) return;
    const answer = await fetch(`/api/v1/speech/${stream}`, {
      method: "POST", headers: { "content-type": "application/octet-stream" }, body,
    });
    if (answer.ok && recording) say((await answer.json()).partial || tr("Recording. Let go to end it."));
  }).catch(() => { stream = null; });
}

function end() {
  if (!recording) return;
  const made = recording;
  recording = null;
  hold.setAttribute("aria-pressed", "false");
  if (made.length < RATE_HZ / 5) { say(tr("That was too short. Hold the button while you speak.")); return; }
  const file = new File([wav(pcm(made.parts, made.length))], "microphone.wav", { type: "audio/wav" });
  const chosen = new DataTransfer();
  chosen.items.add(file);
  field("recording_file").files = chosen.files;
  field("captured_by").value = "microphone";
  field("acquired_s").value = acquired.toFixed(3);
  field("recording_s").value = made.began.toFixed(3);
  say(tr("Writing down what was said."));
  form.requestSubmit(form.querySelector("[formaction='/missions/preview']"));
}

function pcm(parts, length) {
  const made = new Int16Array(length);
  let at = 0;
  for (const part of parts) for (const one of part) made[at++] = Math.max(-32768, Math.min(32767, Math.round(one * 32768)));
  return new Uint8Array(made.buffer);
}

function wav(body) {
  const made = new DataView(new ArrayBuffer(44 + body.length));
  const text = (at, word) => [...word].forEach((one, index) => made.setUint8(at + index, one.charCodeAt(0)));
  text(0, "RIFF"); made.setUint32(4, 36 + body.length, true); text(8, "WAVEfmt ");
  made.setUint32(16, 16, true); made.setUint16(20, 1, true); made.setUint16(22, 1, true);
  made.setUint32(24, RATE_HZ, true); made.setUint32(28, RATE_HZ * 2, true);
  made.setUint16(32, 2, true); made.setUint16(34, 16, true);
  text(36, "data"); made.setUint32(40, body.length, true);
  new Uint8Array(made.buffer).set(body, 44);
  return made.buffer;
}

if (panel && navigator.mediaDevices && window.AudioWorkletNode) {
  panel.hidden = false;
  on.addEventListener("click", acquire);
  hold.addEventListener("pointerdown", begin);
  hold.addEventListener("keydown", (event) => { if (event.key === " " || event.key === "Enter") begin(event); });
  for (const over of ["pointerup", "pointercancel"]) addEventListener(over, end);
  hold.addEventListener("keyup", (event) => { if (event.key === " " || event.key === "Enter") end(); });
  hold.addEventListener("blur", end);
  field("recording_file").addEventListener("change", () => {
    field("captured_by").value = "file";
    field("acquired_s").value = field("recording_s").value = "";
  });
}
