// Comfort: the list of keys, ways by key, UTC or local time, printing, and the newest line in view.
const WAYS = { o: "/", m: "/missions", h: "/handoffs", e: "/evidence" };
const sheet = document.getElementById("keys");
let going = 0;

const inField = (on) => on.closest?.("input, select, textarea, [contenteditable]");
const local = () => localStorage.getItem("clock") === "local";

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
  if (event.target.closest?.("[data-print=now]")) print();
});

function zone() {
  localStorage.setItem("clock", local() ? "utc" : "local");
  times();
  const status = document.getElementById("status");
  if (status) {
    status.textContent = local() ? "All times are shown in local time." : "All times are shown in UTC.";
    setTimeout(() => { if (status.textContent.startsWith("All times")) status.textContent = ""; }, 3000);
  }
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

// The list of events shows the one that the reader stands at, or the newest, without moving the page.
function inView() {
  const box = document.querySelector("#events .scroll");
  if (!box) return;
  const row = box.querySelector("tr[aria-current]") || (document.body.dataset.instant !== "past" ? box.querySelector("tbody tr:last-child") : null);
  if (row) box.scrollTop = row.offsetTop - box.clientHeight / 2;
}

document.addEventListener("htmx:after:swap", () => { if (local()) times(); inView(); });
times();
inView();
