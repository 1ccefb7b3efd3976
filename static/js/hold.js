// Press and hold: pointer, Space or Enter. Letting go early changes nothing. One-tap reasons. A changed question.
import { tr } from "./translations.js";

let timer = null;
let held = null;

function begin(button) {
  if (held || button.disabled) return;
  const reason = button.form.elements.reason;
  if (reason && !reason.reportValidity()) return;
  held = button;
  button.dataset.held = "";
  say(tr("Keep holding."));
  timer = setTimeout(() => {
    end(tr("Sent."));
    button.form.dataset.sure = "";
    button.form.requestSubmit(button);
  }, Number(button.dataset.hold));
}

function end(text) {
  clearTimeout(timer);
  if (held) { delete held.dataset.held; say(text); }
  held = null;
}

function say(text) {
  document.getElementById("status").textContent = text;
}

document.addEventListener("pointerdown", (event) => {
  const button = event.target.closest("button[data-hold]");
  if (button && event.button === 0) begin(button);
});
for (const name of ["pointerup", "pointercancel", "blur"]) addEventListener(name, () => held && end(tr("Let go too early: nothing was sent.")));

document.addEventListener("keydown", (event) => {
  const button = event.target.closest?.("button[data-hold]");
  if (button && (event.key === " " || event.key === "Enter")) { event.preventDefault(); if (!event.repeat) begin(button); }
});
document.addEventListener("keyup", (event) => {
  if (held && (event.key === " " || event.key === "Enter")) { event.preventDefault(); end(tr("Let go too early: nothing was sent.")); }
});
document.addEventListener("submit", (event) => {
  const button = event.submitter;
  if (button?.dataset.hold && !("sure" in event.target.dataset)) event.preventDefault();
});

document.addEventListener("click", (event) => {
  const tap = event.target.closest("button[data-reason]");
  if (!tap) return;
  const field = tap.form.elements.reason;
  field.value = "add" in tap.dataset && field.value.trim() ? `${field.value.trim()}, ${tap.dataset.reason}` : tap.dataset.reason;
  field.focus();
});

// Looking again opens the question anew: what was typed here goes along, unless it was the answer.
const draft = `draft ${location.pathname}`;
const typed = document.querySelector("#decision textarea[name=reason]");
if (typed && !typed.value) typed.value = sessionStorage.getItem(draft) ?? "";
sessionStorage.removeItem(draft);
addEventListener("pagehide", () => {
  const left = document.querySelector("#decision:not([data-sent]) textarea[name=reason]");
  if (left?.value) sessionStorage.setItem(draft, left.value);
});
document.addEventListener("submit", (event) => {
  if (event.target.id === "decision" && event.submitter?.name === "decision" && !event.defaultPrevented) event.target.dataset.sent = "";
});

document.addEventListener("htmx:after:swap", () => {
  const form = document.getElementById("decision");
  const question = document.getElementById("question");
  if (!form || !question) return;
  if (question.dataset.claim) for (const field of question.querySelectorAll("input[name=claim]")) field.value = question.dataset.claim;
  const mine = form.elements.claim.value === question.dataset.claim;
  if (form.elements.cycle.value === question.dataset.cycle && mine && !question.dataset.holder) return;
  form.querySelector("[data-changed]").hidden = false;
  for (const button of form.querySelectorAll("button[name=decision]")) button.disabled = true;
});

// A review whose cycle moved on while somebody read it: their word would be about another question.
document.addEventListener("htmx:after:swap", () => {
  const words = document.getElementById("words");
  const review = document.getElementById("review");
  if (!words || !review || words.querySelector("[data-asked]").dataset.asked === review.dataset.cycle) return;
  words.querySelector("[data-changed]").hidden = false;
  for (const button of words.querySelectorAll("button")) button.disabled = true;
});
