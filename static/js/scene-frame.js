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

document.body.addEventListener("live:resync", () => {
  for (const frame of document.querySelectorAll(".scene iframe")) frame.src = frame.src;
});
