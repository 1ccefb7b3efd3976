// The time cursor: letting go of the slider goes to that instant. Frames that died are loaded again when live.
document.addEventListener("change", (event) => {
  if (event.target.id === "cursor") event.target.form.requestSubmit();
});

document.body.addEventListener("live:resync", () => {
  for (const frame of document.querySelectorAll(".scene iframe")) frame.src = frame.src;
});
