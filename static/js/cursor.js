// The time cursor: letting go of the slider goes to that instant; choosing a template shows its form.
// Frames that died are loaded again when the page is live.
document.addEventListener("change", (event) => {
  if (event.target.id === "cursor" || "go" in event.target.dataset) event.target.form.requestSubmit();
});

for (const frame of document.querySelectorAll(".scene iframe")) {
  frame.addEventListener("load", () => {
    for (const wait of [1500, 5000]) setTimeout(() => document.body.dispatchEvent(new CustomEvent("live:scene")), wait);
  });
}

document.body.addEventListener("live:resync", () => {
  for (const frame of document.querySelectorAll(".scene iframe")) frame.src = frame.src;
});
