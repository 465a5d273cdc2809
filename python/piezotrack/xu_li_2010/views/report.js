"use strict";
// Each picture is zoomed by its viewBox, so that lines stay sharp.
function zoomable(picture) {
  const svg = picture.querySelector("svg");
  const whole = svg.viewBox.baseVal;
  const home = { x: whole.x, y: whole.y, w: whole.width, h: whole.height };
  let view = { ...home }, last = null;
  const show = () => {
    svg.setAttribute("viewBox", [view.x, view.y, view.w, view.h].join(" "));
    picture.classList.toggle("near", view.w < home.w);
  };
  const keep = (value, low, high) => Math.min(Math.max(value, low), high);
  // Zoom about a place given in parts of what is shown.
  const zoom = (factor, px = 0.5, py = 0.5) => {
    const w = keep(view.w / factor, home.w / 40, home.w), h = home.h * w / home.w;
    move(view.x + px * (view.w - w), view.y + py * (view.h - h), w, h);
  };
  const move = (x, y, w = view.w, h = view.h) => {
    view = { x: keep(x, home.x, home.x + home.w - w), y: keep(y, home.y, home.y + home.h - h), w, h };
    show();
  };
  picture.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && view.w >= home.w) return;  // The page scrolls until one has zoomed.
    event.preventDefault();
    const box = svg.getBoundingClientRect();
    zoom(event.deltaY < 0 ? 1.25 : 0.8, (event.clientX - box.left) / box.width,
      (event.clientY - box.top) / box.height);
  }, { passive: false });
  svg.addEventListener("pointerdown", (event) => {
    if (view.w < home.w) { last = event; svg.setPointerCapture(event.pointerId); }
  });
  svg.addEventListener("pointermove", (event) => {
    if (!last) return;
    const scale = view.w / svg.getBoundingClientRect().width;
    move(view.x - scale * (event.clientX - last.clientX), view.y - scale * (event.clientY - last.clientY));
    last = event;
  });
  for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => { last = null; });
  svg.addEventListener("dblclick", (event) => {
    const box = svg.getBoundingClientRect();
    zoom(2.5, (event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  });
  const bar = document.createElement("div");
  bar.className = "zoom";
  const buttons = { "+": ["zoom in", () => zoom(1.8)], "\u2212": ["zoom out", () => zoom(1 / 1.8)],
    "\u21ba": ["show all", () => { view = { ...home }; show(); }] };
  for (const [label, [title, act]] of Object.entries(buttons)) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: label, title });
    button.setAttribute("aria-label", title);
    button.addEventListener("click", act);
    bar.append(button);
  }
  picture.before(bar);
  // Drawn where it has lines and a size.
  const box = svg.getBoundingClientRect();
  return box.width > 0 && box.height > 0 && svg.querySelectorAll("path").length > 20;
}
const pictures = [...document.querySelectorAll(".picture")];
document.documentElement.dataset.drawn = pictures.filter(zoomable).length + " of " + pictures.length;
