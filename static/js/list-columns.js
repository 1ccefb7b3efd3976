// On a phone a row of a list stands on end: every cell then says which column it is of.
function columns() {
  for (const table of document.querySelectorAll(".list, .stacked")) {
    const names = [...table.querySelectorAll("thead th")].map((one) => one.textContent.trim());
    for (const cell of table.querySelectorAll("tbody td")) if (names[cell.cellIndex]) cell.dataset.column = names[cell.cellIndex];
  }
}

document.addEventListener("htmx:after:swap", columns);
columns();
