// Says that a sound was played to its end here. Nothing is sent or stored: it shows nothing about who listened.
import { tr } from "./translations.js";

document.addEventListener("ended", (event) => {
  const note = document.getElementById(event.target.dataset?.played ?? "");
  if (note) note.textContent = tr("Played in this browser to its end. Whether somebody listened is not known.");
}, true);
