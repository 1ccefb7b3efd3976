// UTC or the reader's own time: every <time datetime> of the page, by the key u or a button.
import { say } from "./announce.js";
import { tr } from "./translations.js";

const local = () => localStorage.getItem("clock") === "local";

document.addEventListener("click", (event) => { if (event.target.closest?.("[data-zone]")) zone(); });

export function zone() {
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

document.addEventListener("htmx:after:swap", () => { if (local()) times(); });
times();
