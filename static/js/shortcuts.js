// Keys of the whole console: the list of keys, ways to pages, the search field, UTC or local time; and printing.
import { zone } from "./local-times.js";

const WAYS = { o: "/", m: "/missions", h: "/handoffs", a: "/alerts", r: "/robots", e: "/evidence", s: "/missions/new" };
const sheet = document.getElementById("keys");
let going = 0;

const inField = (on) => on.closest?.("input, select, textarea, [contenteditable]");

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
  if (event.target.closest?.("[data-print=now]")) print();
});
