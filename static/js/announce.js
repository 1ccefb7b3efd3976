// A short word in the one status line: it is read aloud, takes no focus and goes by itself.
export function say(text) {
  const status = document.getElementById("status");
  if (!status) return;
  status.textContent = text;
  setTimeout(() => { if (status.textContent === text) status.textContent = ""; }, 4000);
}

