// A curve through points that are dragged, added by a click beside them and removed by Delete; drawn as the parameters
// `interpolation` and `beyond` have it.

import { fill, h, s } from "../lib/dom.js";
import { curved } from "../lib/pchip.js";

const SIZE = 200;
const GAP = 0.005;

export function curve(kind, { label, value, changed }) {
  let points = value ?? [
    [0, 0],
    [1, 1],
  ];
  let way = {};
  const line = s("polyline", { class: "curve-line" });
  const marks = s("g");
  const area = s(
    "svg",
    { class: "curve", viewBox: `-10 -10 ${SIZE + 20} ${SIZE + 20}`, role: "group", "aria-label": label },
    s("rect", { class: "curve-back", width: SIZE, height: SIZE }),
    s("path", {
      class: "curve-grid",
      d: [1, 2, 3].map((i) => `M${(i * SIZE) / 4} 0V${SIZE}M0 ${(i * SIZE) / 4}H${SIZE}`).join(""),
    }),
    line,
    marks,
  );

  const place = ([x, y]) => [x * SIZE, (1 - y) * SIZE];
  const at = (event) => {
    const box = area.getBoundingClientRect();
    const unit = (SIZE + 20) / box.width;
    const [x, y] = [(event.clientX - box.left) * unit - 10, (event.clientY - box.top) * unit - 10];
    return [Math.min(1, Math.max(0, x / SIZE)), Math.min(1, Math.max(0, 1 - y / SIZE))].map((each) =>
      Number(each.toFixed(3)),
    );
  };
  const kept = (index, [x, y]) => {
    const low = index > 0 ? points[index - 1][0] + GAP : 0;
    const high = index < points.length - 1 ? points[index + 1][0] - GAP : 1;
    return [Math.min(high, Math.max(low, x)), Math.min(1, Math.max(0, y))].map((each) => Number(each.toFixed(3)));
  };
  const move = (index, to, dragging) => {
    points = points.map((each, i) => (i === index ? kept(index, to) : each));
    draw();
    changed(points, dragging);
  };

  function draw() {
    line.setAttribute("points", curved(points, way).map((each) => place(each).join(",")).join(" "));
    const focused = [...marks.children].indexOf(document.activeElement);
    fill(
      marks,
      points.map((each, index) => mark(each, index)),
    );
    if (focused >= 0) marks.children[Math.min(focused, points.length - 1)]?.focus();
  }

  function mark(each, index) {
    const [cx, cy] = place(each);
    return s("circle", {
      class: "curve-point",
      cx,
      cy,
      r: 7,
      tabindex: 0,
      role: "slider",
      "aria-label": `point ${index + 1}`,
      "aria-valuenow": each[1],
      "aria-valuemin": 0,
      "aria-valuemax": 1,
      "aria-valuetext": `${each[0]} becomes ${each[1]}`,
      onpointerdown: (event) => {
        event.stopPropagation();
        drag(event, index);
      },
      onkeydown: (event) => press(event, index),
    });
  }

  function drag(event, index) {
    area.setPointerCapture(event.pointerId);
    const follow = (moved) => move(index, at(moved), true);
    const end = (ended) => {
      area.removeEventListener("pointermove", follow);
      move(index, at(ended), false);
    };
    area.addEventListener("pointermove", follow);
    area.addEventListener("pointerup", end, { once: true });
  }

  function press(event, index) {
    const step = event.shiftKey ? 0.1 : 0.01;
    const by = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
    if (by)
      move(
        index,
        points[index].map((each, i) => each + by[i]),
        false,
      );
    else if ((event.key === "Delete" || event.key === "Backspace") && points.length > 2) {
      points = points.filter((_, i) => i !== index);
      draw();
      changed(points, false);
    } else return;
    event.preventDefault();
  }

  area.addEventListener("pointerdown", (event) => {
    const [x, y] = at(event);
    const index = points.findIndex((each) => each[0] > x);
    if (index <= 0 || x - points[index - 1][0] < GAP || points[index][0] - x < GAP) return;
    points = [...points.slice(0, index), [x, y], ...points.slice(index)];
    draw();
    drag(event, index);
  });
  draw();
  const set = (now) => {
    points = now ?? points;
    draw();
  };
  const beside = (value) => {
    way = { straight: value("interpolation") === "linear", extend: value("beyond") === "extend" };
    draw();
  };
  return { element: h("div", { class: "curve-box" }, area), set, beside, group: true };
}
