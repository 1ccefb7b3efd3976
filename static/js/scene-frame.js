// The 3D view's frame: the page's own words on it follow once it is loaded; it is opened anew after a lost link.
for (const frame of document.querySelectorAll(".scene iframe")) {
  frame.addEventListener("load", () => {
    for (const wait of [1500, 5000]) setTimeout(() => document.body.dispatchEvent(new CustomEvent("live:scene")), wait);
  });
}

document.body.addEventListener("live:resync", () => {
  for (const frame of document.querySelectorAll(".scene iframe")) frame.src = frame.src;
});
