// Sends a chosen file in pieces, shows how far it is, and can be cancelled. Without scripts the form sends small files.
import { tr } from "./translations.js";

const form = document.querySelector("[data-upload]");
const said = form?.querySelector("[data-said]");
const moving = form?.querySelector("[data-moving]");
const bar = form?.querySelector("progress");
let sending = null;

// What is begun is always answered: without its id a cancelled upload could not be removed.
async function asked(path, options, signal = sending.signal) {
  for (let tries = 0; ; tries += 1) {
    const answer = await fetch(`/api/v1${path}`, { ...options, signal });
    if (answer.ok) return answer.json();
    if (answer.status === 429 && tries < 20) {
      await new Promise((done) => setTimeout(done, 1000 * Number(answer.headers.get("retry-after") || 1)));
      continue;
    }
    const problem = await answer.json().catch(() => ({}));
    throw new Error(problem.detail || problem.title || tr("The console answered {status}.", { status: answer.status }));
  }
}

// Several files are sent as one: their bytes follow each other, and the console takes them apart again.
async function sent(files) {
  const file = files.length === 1 ? files[0] : new Blob(files);
  const name = files.length === 1 ? files[0].name : `${files[0].name} +${files.length - 1}`;
  const parts = files.length === 1 ? [] : files.map((one) => ({ name: one.name, size_bytes: one.size }));
  const begun = await asked("/uploads", {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ name, size_bytes: file.size, parts }),
  }, null);
  sending.id = begun.upload_id;
  sending.signal.throwIfAborted();
  for (let at = 0; at < file.size; at += begun.piece_bytes) {
    const body = file.slice(at, at + begun.piece_bytes);
    await asked(`/uploads/${begun.upload_id}?offset=${at}`, {
      method: "POST", headers: { "content-type": "application/octet-stream" }, body,
    });
    bar.value = Math.min(1, (at + body.size) / file.size);
    said.textContent = tr("{percent} % of {name}", { percent: Math.floor(100 * bar.value), name });
  }
}

function rest() {
  moving.hidden = true;
  form.querySelector("button.primary").disabled = false;
  sending = null;
}

form?.addEventListener("submit", async (event) => {
  const files = [...form.querySelector("input[type=file]").files];
  if (!files.length || sending) return;
  event.preventDefault();
  if (files.reduce((sum, one) => sum + one.size, 0) > Number(form.dataset.limit)) {
    said.textContent = tr("{name} is too large.", { name: files[0].name });
    return;
  }
  sending = new AbortController();
  moving.hidden = false;
  bar.value = 0;
  form.querySelector("button.primary").disabled = true;
  try {
    await sent(files);
    window.location.assign("/recordings");
  } catch (error) {
    const { id } = sending;
    if (id) await fetch(`/api/v1/uploads/${id}`, { method: "DELETE" }).catch(() => {});
    said.textContent = error.name === "AbortError" ? tr("Cancelled.") : error.message;
    rest();
  }
});

form?.querySelector("[data-cancel]").addEventListener("click", () => sending?.abort());
