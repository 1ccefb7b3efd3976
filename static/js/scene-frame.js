// The 3D view's frame: the page's own words on it follow once it is loaded; it is opened anew after a lost link.
import { tr } from "./translations.js";

const NOTICE = '.mantine-Notification-root[style*="orange"]';

for (const frame of document.querySelectorAll(".scene iframe")) {
  frame.addEventListener("load", () => {
    for (const wait of [1500, 5000]) setTimeout(() => {
      document.body.dispatchEvent(new CustomEvent("live:scene"));
      if (frame.contentDocument?.querySelector(NOTICE)) frame.closest("section").querySelector("[data-software]").hidden = false;
    }, wait);
  });
}

for (const button of document.querySelectorAll("[data-full-screen]")) {
  button.hidden = !document.fullscreenEnabled;
  button.addEventListener("click", () => document.fullscreenElement ? document.exitFullscreen() : button.parentElement.requestFullscreen());
  button.parentElement.addEventListener("fullscreenchange", () => {
    button.textContent = document.fullscreenElement ? tr("Leave full screen") : tr("Full screen");
  });
}

function openAnew({ currentTarget: frame }) {
  frame.src = frame.src;
}

// A frame that is left while its document is read ends halfway, and viser's client finds no place to draw in.
document.body.addEventListener("live:resync", () => {
  if (document.body.dataset.link === "opening") return;
  for (const frame of document.querySelectorAll(".scene iframe")) {
    if (frame.contentDocument?.readyState === "loading") frame.addEventListener("load", openAnew, { once: true });
    else openAnew({ currentTarget: frame });
  }
});
