// One time cursor for the whole mission page: graph, stages, lanes, plots, images, events and the reader's own 3D view.
// The instant stands in the address (?t=seconds or ?at=event) and survives a reload; without one the page follows live.
import { tr } from "./translations.js";

const dock = document.getElementById("dock");
const WIDTH = 99;

if (dock) begin();

function begin() {
  const slider = document.getElementById("cursor");
  const follow = document.getElementById("follow");
  const play = dock.querySelector("[data-key=play]");
  const base = `/missions/${dock.dataset.mission}`;
  let live = "live" in dock.dataset;
  let t = Number(slider.value);
  let playing = 0;
  let shownPlace = -1;
  let loading = false;
  let wanted = null;
  let seeking = false;
  let sought = null;
  let together = false;

  const marks = () => (document.getElementById("timeline").dataset.marks || "").split(" ").filter(Boolean).map((one) => {
    const [position, second] = one.split("@");
    return { position, t: Number(second) };
  });
  const total = () => Number(slider.max);
  const clock = (s) => `${String(Math.floor(s / 60)).padStart(2, "0")}:${(s % 60).toFixed(1).padStart(4, "0")}`;
  const placeOf = (list, second) => { let n = 0; for (const one of list) if (one.t <= second + 1e-3) n++; return Math.max(n, 1); };

  function draw(place, count) {
    const left = `${(WIDTH * Math.min(t / Math.max(total(), 0.001), 1)).toFixed(3)}%`;
    for (const line of document.querySelectorAll("line.cursor")) { line.setAttribute("x1", left); line.setAttribute("x2", left); }
    slider.value = t;
    document.getElementById("cursor-time").textContent = tr("{here} of {end}", { here: clock(t), end: clock(total()) });
    document.getElementById("cursor-place").textContent = tr("event {place} of {count}", { place, count });
    const text = live ? tr("following") : tr("back to now");
    if (follow.textContent !== text) follow.textContent = text;
    for (const plot of document.querySelectorAll("svg.plot")) value(plot);
  }

  // What a plot says at the cursor, read from its own line.
  function value(plot) {
    const x = 10 * WIDTH * Math.min(t / Math.max(total(), 0.001), 1);
    let y = null;
    for (const line of plot.querySelectorAll("polyline")) {
      for (const point of line.points) { if (point.x <= x + 0.5) y = point.y; else break; }
    }
    const cell = document.querySelector(`[data-value="${plot.dataset.plot}"]`);
    const low = Number(plot.dataset.low), high = Number(plot.dataset.high);
    const text = y === null ? "" : `${(low + (high - low) * (38 - y) / 36).toFixed(2)} ${plot.dataset.unit}`.trim();
    if (cell && cell.textContent !== text) cell.textContent = text;
  }

  function address(param) {
    const query = new URLSearchParams(location.search);
    query.delete("at");
    query.delete("t");
    if (param) query.set(...param);
    const text = query.toString().replace(/\+/g, "%20");
    return text ? `?${text}` : "";
  }

  // Go to an instant. `param` names it in the address; null follows the newest event.
  function seek(second, param) {
    live = param === null;
    t = Math.min(Math.max(second, 0), total());
    document.body.dataset.instant = live ? "live" : "past";
    const list = marks();
    const place = live ? list.length : param[0] === "at" ? list.findIndex((one) => one.position === param[1]) + 1 : placeOf(list, t);
    draw(place, list.length);
    history.replaceState(null, "", location.pathname + address(param) + location.hash);
    const changed = place !== shownPlace;
    shownPlace = place;
    if (changed || live || !playing) load(address(param));
    scene(live ? null : t);
  }

  // All regions of an instant at once, morphed in place; of several instants asked for meanwhile only the last counts.
  async function load(query) {
    wanted = query;
    if (loading) return;
    loading = true;
    while (wanted !== null) {
      const now = wanted;
      wanted = null;
      try {
        await window.htmx.ajax("GET", `${base}/instant${now}`, { source: "#loader", target: "#loader", swap: "none" });
      } catch { /* the live stream says when the console is gone */ }
    }
    loading = false;
    draw(live ? marks().length : shownPlace, marks().length);
  }

  async function scene(second) {
    sought = second;
    if (seeking) return;
    seeking = true;
    let done;
    do {
      done = sought;
      const query = done === null ? "" : `?t=${done.toFixed(3)}`;
      try { await fetch(`${base}/scene/${dock.dataset.view}/instant${query}`, { method: "POST" }); } catch { /* as above */ }
    } while (done !== sought);
    seeking = false;
  }

  function step(by) {
    const list = marks();
    const here = live ? list.length : shownPlace > 0 ? shownPlace : placeOf(list, t);
    const next = Math.min(Math.max(here + by, 1), list.length);
    const one = list[next - 1];
    if (one) seek(one.t, ["at", one.position]);
  }

  function toggle() {
    if (playing) { cancelAnimationFrame(playing); playing = 0; press(false); seek(t, ["t", t.toFixed(1)]); return; }
    if (t >= total() - 0.05) t = 0;
    let last = performance.now();
    press(true);
    const tick = (now) => {
      t += (now - last) / 1000 * Number(dock.querySelector("[data-key=speed]").value);
      last = now;
      if (t >= total()) { playing = 0; press(false); seek(total(), ["t", total().toFixed(1)]); return; }
      playing = requestAnimationFrame(tick);
      seek(t, ["t", t.toFixed(1)]);
    };
    playing = requestAnimationFrame(tick);
  }

  function press(on) {
    play.setAttribute("aria-pressed", String(on));
    play.textContent = on ? tr("Pause") : tr("Play");
    play.setAttribute("aria-label", play.textContent);
  }

  function pause() {
    if (playing) { cancelAnimationFrame(playing); playing = 0; press(false); }
  }

  const keys = {
    begin: () => { pause(); seek(0, ["t", "0"]); },
    earlier: () => { pause(); step(-1); },
    play: toggle,
    later: () => { pause(); step(1); },
    follow: () => { pause(); seek(total(), null); },
  };

  slider.addEventListener("input", () => { pause(); seek(Number(slider.value), ["t", Number(slider.value).toFixed(1)]); });
  dock.addEventListener("submit", (event) => event.preventDefault());
  for (const button of dock.querySelectorAll("button[data-key]")) button.addEventListener("click", () => keys[button.dataset.key]());
  follow.addEventListener("click", (event) => { event.preventDefault(); keys.follow(); });

  document.addEventListener("click", (event) => {
    const tick = event.target.closest?.("a[data-at]");
    const axis = event.target.closest?.("svg.lane, svg.plot");
    if (!axis || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    pause();
    if (tick) {
      const one = marks().find((mark) => mark.position === tick.dataset.at);
      if (one) seek(one.t, ["at", one.position]);
      return;
    }
    const box = axis.getBoundingClientRect();
    const second = (event.clientX - box.left) / box.width * 100 / WIDTH * total();
    seek(second, ["t", Math.min(Math.max(second, 0), total()).toFixed(1)]);
  });

  // A stage chosen while the regions still load keeps the instant that the dock stands at.
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("main a[href*='node=']");
    if (!link || new URL(link.href, location.href).pathname !== base) return;
    const to = new URL(link.href, location.href), here = new URLSearchParams(location.search);
    for (const name of ["at", "t"]) { to.searchParams.delete(name); if (here.has(name)) to.searchParams.set(name, here.get(name)); }
    link.href = to.pathname + to.search + to.hash;
  }, true);

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const on = event.target;
    const own = on === slider;
    if (!own && on.closest?.("input, select, textarea, [contenteditable]")) return;
    if (event.key === " " && on.closest?.("button, a, summary, audio")) return;
    if (on.closest?.(".scroll[tabindex]") && ["Home", "End"].includes(event.key)) return;
    const act = { ArrowLeft: keys.earlier, ArrowRight: keys.later, " ": keys.play, Home: keys.begin, End: keys.follow }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });

  // What the log gained is fetched once for the whole page, not region by region.
  document.addEventListener("live:mission", () => {
    if (!live) return;
    together = true;
    setTimeout(() => { together = false; });
    load(address(null));
  }, true);

  // While the page shows the past, what happens now must not be drawn into it.
  document.addEventListener("htmx:before:request", (event) => {
    const from = event.detail.ctx?.sourceElement;
    if ((!live || together) && from?.dataset.region) event.preventDefault();
  });
  document.addEventListener("htmx:after:swap", () => {
    const list = marks();
    const newest = document.getElementById("plots")?.dataset.total;
    const until = Math.max(newest ? Number(newest) : 0, list.length ? list[list.length - 1].t : 0);
    if (Math.abs(until - total()) > 0.05) slider.max = (Math.ceil(until * 10) / 10).toFixed(1);
    if (live) { t = total(); shownPlace = list.length; draw(list.length, list.length); }
    // An answer about an instant that was left meanwhile does not put its values at the newer one.
    else if (wanted !== null) draw(shownPlace, list.length);
  });

  document.body.dataset.instant = live ? "live" : "past";
  shownPlace = live ? marks().length : placeOf(marks(), t);
  const named = new URLSearchParams(location.search).get("at");
  if (named) shownPlace = Math.max(marks().findIndex((one) => one.position === named) + 1, 1);
  draw(shownPlace, marks().length);
  if (!live) scene(t);
}
