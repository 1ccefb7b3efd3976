// A click on the map adds a waypoint; the field moves the line. Without scripts the field does.
const map = document.querySelector("[data-pick]");
const line = document.querySelector("[data-line]");
const waypoints = document.querySelector("textarea[name=waypoints]");

function draw() {
  const points = waypoints.value.split(";").map((one) => one.split(",").map(Number));
  const known = points.filter((one) => one.length === 2 && one.every(Number.isFinite));
  line.setAttribute("points", known.map(([x, y]) => `${x},${-y}`).join(" "));
}

if (map && line && waypoints) {
  map.addEventListener("click", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
    const before = waypoints.value.trim().replace(/;$/, "");
    waypoints.value = `${before ? `${before}; ` : ""}${at.x.toFixed(2)}, ${(-at.y).toFixed(2)}`;
    draw();
  });
  waypoints.addEventListener("input", draw);
}
