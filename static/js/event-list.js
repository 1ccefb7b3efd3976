// The list of events shows the one that the reader stands at, or the newest, without moving the page.
function inView() {
  const box = document.querySelector("#events .scroll");
  if (!box) return;
  const row = box.querySelector("tr[aria-current]") || (document.body.dataset.instant !== "past" ? box.querySelector("tbody tr:last-child") : null);
  if (row) box.scrollTop = row.offsetTop - box.clientHeight / 2;
}

document.addEventListener("htmx:after:swap", inView);
inView();
