// A click on the map fills the number fields; the fields move the spot. Without scripts the fields do.
const map = document.querySelector("[data-pick]");
const spot = document.querySelector("[data-spot]");
const field = (name) => document.querySelector(`input[name="${name}"]`);

function move() {
  const x = Number(field("x").value), y = Number(field("y").value);
  if (Number.isFinite(x) && Number.isFinite(y)) { spot.setAttribute("cx", x); spot.setAttribute("cy", -y); }
}

if (map && spot) {
  map.addEventListener("click", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
    field("x").value = at.x.toFixed(2);
    field("y").value = (-at.y).toFixed(2);
    move();
  });
  for (const name of ["x", "y"]) field(name).addEventListener("input", move);
}
