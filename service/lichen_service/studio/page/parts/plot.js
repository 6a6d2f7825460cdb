// Error against time, both logarithmic: every setting of every method as a point, the front as a line, the one in use
// ringed. Points are buttons: a click, or Enter, runs that setting; arrow keys go from one to the next.

import { h, s } from "../lib/dom.js";
import { named } from "../lib/front.js";
import { decades, milliseconds, short } from "../lib/numbers.js";

const WIDTH = 360;
const HEIGHT = 236;
const EDGE = { left: 52, right: 12, top: 12, bottom: 40 };
const REACH = 18; // how far from a point a click still means it
const SHAPES = ["circle", "square", "diamond", "triangle", "down", "plus"];

export function plot(points, { by, wanted, chosen }) {
  const methods = [...new Set(points.map((each) => each.method))];
  const x = axis(
    points.map((each) => each.error),
    EDGE.left + 6,
    WIDTH - EDGE.right - 6,
  );
  const y = axis(
    points.map((each) => each.ms),
    HEIGHT - EDGE.bottom - 6,
    EDGE.top + 6,
  );
  const tip = h("p", { class: "plot-tip", role: "status" });
  const say = (point) => {
    tip.textContent = point ? sentence(point) : hint;
  };
  const hint = chosen ? "Choose a point to run that setting." : "";
  const marks = points.map((point) =>
    mark(point, methods.indexOf(point.method), [x.at(point.error), y.at(point.ms)], { chosen, say }),
  );
  rove(marks, points);
  say(points.find((each) => each.chosen));
  const places = points.map((each) => [x.at(each.error), y.at(each.ms)]);
  const near = (event) => nearest(places, event);
  const drawing = s(
    "svg",
    {
      class: "plot",
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "group",
      "aria-label": "Error against time of every setting",
      onclick: (event) => {
        const index = near(event);
        if (index >= 0) chosen?.(points[index]);
      },
      onpointermove: (event) => {
        const index = near(event);
        marks.forEach((each, i) => each.classList.toggle("near", i === index));
        say(points[index]);
      },
      onpointerleave: () => {
        marks.forEach((each) => each.classList.remove("near"));
        say(null);
      },
    },
    grid(x, y),
    labels(by),
    line(points, x, y),
    wanted ? limit(x.at(wanted), wanted) : null,
    marks,
  );
  return h("figure", { class: "plot-figure" }, drawing, legend(methods), h("figcaption", tip));
}

const sentence = (each) =>
  `${named(each)}: ${each.by === "typical" ? "typical error" : "error"} ${short(each.error)}${each.kind && each.by !== "typical" ? ` (${each.kind})` : ""}, ${milliseconds(each.ms)}. ${each.front ? "On the front: nothing is as fast and as accurate." : capital(each.verdict)}`;
const capital = (text) => (text ? `${text[0].toUpperCase()}${text.slice(1)}.` : "");

// The point that a pointer means: the nearest, if it is near at all.
function nearest(places, event) {
  const box = event.currentTarget.getBoundingClientRect();
  const unit = WIDTH / box.width;
  const away = places.map(([x, y]) =>
    Math.hypot((event.clientX - box.left) * unit - x, (event.clientY - box.top) * unit - y),
  );
  const index = away.indexOf(Math.min(...away));
  return away[index] <= REACH ? index : -1;
}

// Zero has no logarithm: it stands a decade below the smallest of the others.
function axis(values, start, end) {
  const above = values.filter((each) => each > 0);
  let [low, high] = above.length ? [Math.min(...above), Math.max(...above)] : [0.1, 1];
  const zero = values.some((each) => each === 0) ? low / 10 : null;
  if (zero) low = zero;
  if (high / low < 4) [low, high] = [low / 2, high * 2];
  const at = (value) =>
    start +
    ((end - start) * Math.log(Math.min(Math.max(value || zero || low, low), high) / low)) / Math.log(high / low);
  return { at, low, high, marks: decades(low, high).filter((each) => !zero || each > zero * 1.5), zero };
}

function grid(x, y) {
  const bottom = HEIGHT - EDGE.bottom;
  return s(
    "g",
    { class: "plot-grid" },
    s("path", { d: `M${EDGE.left} ${EDGE.top}V${bottom}H${WIDTH - EDGE.right}`, class: "plot-axis" }),
    x.marks.map((each) => [
      s("path", { d: `M${x.at(each)} ${EDGE.top}V${bottom}` }),
      s("text", { x: x.at(each), y: bottom + 14, "text-anchor": "middle" }, short(each, 1)),
    ]),
    x.zero ? s("text", { x: x.at(0), y: bottom + 14, "text-anchor": "middle" }, "0") : null,
    y.marks.map((each) => [
      s("path", { d: `M${EDGE.left} ${y.at(each)}H${WIDTH - EDGE.right}` }),
      s("text", { x: EDGE.left - 6, y: y.at(each) + 4, "text-anchor": "end" }, short(each, 2)),
    ]),
  );
}

const labels = (by) =>
  s(
    "g",
    { class: "plot-labels" },
    s(
      "text",
      { x: (EDGE.left + WIDTH - EDGE.right) / 2, y: HEIGHT - 6, "text-anchor": "middle" },
      by === "typical" ? "typical error" : "largest error",
    ),
    s(
      "text",
      { x: -(HEIGHT - EDGE.bottom + EDGE.top) / 2, y: 12, transform: "rotate(-90)", "text-anchor": "middle" },
      "milliseconds",
    ),
  );

function line(points, x, y) {
  const along = points.filter((each) => each.front).sort((a, b) => a.ms - b.ms);
  return s("polyline", {
    class: "plot-front",
    points: along.map((each) => `${x.at(each.error)},${y.at(each.ms)}`).join(" "),
  });
}

const limit = (at, wanted) =>
  s(
    "g",
    { class: "plot-limit" },
    s("path", { d: `M${at} ${EDGE.top}V${HEIGHT - EDGE.bottom}` }),
    s("title", `an error of ${short(wanted)} is asked for`),
  );

function mark(point, method, [cx, cy], { chosen, say }) {
  const about = `${sentence(point)}${point.chosen ? " In use." : ""}`;
  const element = s(
    "g",
    {
      class: `plot-point series-${method % 6}${point.front ? " on-front" : ""}${point.chosen ? " in-use" : ""}`,
      role: "button",
      tabindex: -1,
      "aria-label": about,
      "aria-pressed": String(Boolean(point.chosen)),
      transform: `translate(${cx} ${cy})`,
      "data-method": point.method,
      "data-knob": point.knob ?? "",
      onfocus: () => say(point),
      onkeydown: (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          chosen?.(point);
        }
      },
    },
    s("circle", { r: 12, class: "plot-reach" }),
    point.chosen ? s("circle", { r: 9, class: "plot-ring" }) : null,
    shape(method, point.front ? 5 : 4),
  );
  return element;
}

function shape(method, r) {
  const paths = {
    circle: `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`,
    square: `M${-r} ${-r}h${2 * r}v${2 * r}h${-2 * r}z`,
    diamond: `M0 ${-r - 1}L${r + 1} 0L0 ${r + 1}L${-r - 1} 0z`,
    triangle: `M0 ${-r - 1}L${r + 1} ${r}H${-r - 1}z`,
    down: `M0 ${r + 1}L${r + 1} ${-r}H${-r - 1}z`,
    plus: `M-1.5 ${-r}h3v${r - 1.5}h${r - 1.5}v3h${-r + 1.5}v${r - 1.5}h-3v${-r + 1.5}h${-r + 1.5}v-3h${r - 1.5}z`,
  };
  const turn = Math.floor(method / SHAPES.length); // the seventh method has the colour of the first, and another shape
  return s("path", { d: paths[SHAPES[(method + turn) % SHAPES.length]], class: "plot-shape" });
}

function legend(methods) {
  return h(
    "ul",
    { class: "plot-legend" },
    methods.map((name, i) =>
      h(
        "li",
        s(
          "svg",
          { viewBox: "-8 -8 16 16", class: `series-${i % 6} on-front`, "aria-hidden": "true" },
          s("g", { class: "plot-point" }, shape(i, 5)),
        ),
        name,
      ),
    ),
  );
}

// One stop for the tab key; arrows go on by error.
function rove(marks, points) {
  const order = points
    .map((_, i) => i)
    .sort((a, b) => points[a].error - points[b].error || points[a].ms - points[b].ms);
  const start = Math.max(
    0,
    points.findIndex((each) => each.chosen),
  );
  marks[start]?.setAttribute("tabindex", 0);
  order.forEach((index, place) =>
    marks[index].addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      const next = marks[order[(place + step + order.length) % order.length]];
      marks[index].setAttribute("tabindex", -1);
      next.setAttribute("tabindex", 0);
      next.focus();
    }),
  );
}
