// The graph of a plan: nodes in layers from above to below, those that run as one kernel in a common box, those that were
// dropped greyed, and under each the time it is predicted to take.

import { h, s } from "../lib/dom.js";
import { setting } from "../lib/front.js";
import { milliseconds, short } from "../lib/numbers.js";

const NODE = { width: 216, height: 54 };
const GAP = { x: 26, y: 28 };
const DROPPING = ["dropped", "skipped"];

// `measured` holds milliseconds by node, as the run told them: what ran as one kernel is told under its last node.
export function graph(plan, measured = new Map()) {
  const nodes = new Map(plan.nodes.map((each) => [each.name, { ...each, from: sources(each) }]));
  const dropped = plan.decisions.filter(
    (each) => DROPPING.includes(each.action) && each.node !== "*" && !nodes.has(each.node),
  );
  for (const each of dropped) nodes.set(each.node, { name: each.node, operation: each.action, from: [], gone: each });
  const layers = layered([...nodes.values()].filter((each) => !each.gone));
  const places = placed(
    layers,
    [...nodes.values()].filter((each) => each.gone),
  );
  const width = Math.max(...[...places.values()].map(({ x }) => x + NODE.width), NODE.width) + 16;
  const height = Math.max(...[...places.values()].map(({ y }) => y + NODE.height), NODE.height) + 20;
  const inside = new Set(plan.fused.flatMap((chain) => chain.slice(0, -1)));
  const time = (each) =>
    measured.size ? (measured.get(each.name) ?? (inside.has(each.name) ? 0 : predicted(each))) : predicted(each);
  const most = Math.max(...plan.nodes.map(time), 1e-9);
  const told = (each) => (inside.has(each.name) && measured.size ? "in this kernel" : milliseconds(time(each)));
  const drawing = s(
    "svg",
    {
      class: "graph",
      viewBox: `0 0 ${width} ${height}`,
      role: "img",
      "aria-label": described(plan, dropped),
    },
    s(
      "defs",
      s(
        "marker",
        { id: "arrow", viewBox: "0 0 8 8", refX: 7, refY: 4, markerWidth: 7, markerHeight: 7, orient: "auto" },
        s("path", { d: "M0 0L8 4L0 8z", class: "graph-tip" }),
      ),
    ),
    boxes(plan, places),
    edges(nodes, places),
    [...nodes.values()].map((each) => node(each, places.get(each.name), time(each) / most, told(each))),
  );
  drawing.style.setProperty("--natural", `${width}px`); // as wide as there is room, and no smaller than can be read
  return h(
    "div",
    { class: "scroll graph-scroll", tabindex: 0, role: "region", "aria-label": "Graph of the plan" },
    nodes.size ? drawing : h("p", { class: "muted" }, "Nothing runs: the result is the input."),
  );
}

const sources = (each) => Object.values(each.inputs ?? {});
const taken = (each) => each.alternatives?.find((one) => one.verdict === "taken");
const predicted = (each) => taken(each)?.milliseconds ?? 0;

function described(plan, dropped) {
  const run = plan.nodes.map((each) => `${each.name} by ${each.method}`).join(", then ");
  return `${run || "nothing"} runs.${dropped.length ? ` ${dropped.map((each) => `${each.node} is left out: ${each.reason}`).join(". ")}.` : ""}`;
}

function layered(nodes) {
  const depth = new Map();
  const names = new Map(nodes.map((each) => [each.name, each]));
  const of = (each) => {
    if (!depth.has(each.name)) {
      depth.set(each.name, 0); // a plan has no cycles; this only ends one that came all the same
      depth.set(each.name, 1 + Math.max(-1, ...each.from.map((name) => (names.has(name) ? of(names.get(name)) : -1))));
    }
    return depth.get(each.name);
  };
  const layers = [];
  for (const each of nodes) (layers[of(each)] ??= []).push(each);
  return layers;
}

function placed(layers, gone) {
  const places = new Map();
  const [across, down] = [NODE.width + GAP.x, NODE.height + GAP.y];
  const widest = Math.max(...layers.map((each) => each.length), 0);
  layers.forEach((layer, row) =>
    layer.forEach((each, index) =>
      places.set(each.name, { x: 14 + (index + (widest - layer.length) / 2) * across, y: 26 + row * down }),
    ),
  );
  gone.forEach((each, row) => places.set(each.name, { x: 14 + widest * across, y: 26 + row * (NODE.height + 12) }));
  return places;
}

// What runs as one kernel, within one line.
function boxes(plan, places) {
  return plan.fused
    .filter((chain) => chain.length > 1)
    .map((chain) => {
      const all = chain.map((name) => places.get(name)).filter(Boolean);
      if (!all.length) return null;
      const [left, top] = [Math.min(...all.map((each) => each.x)) - 9, Math.min(...all.map((each) => each.y)) - 21];
      const right = Math.max(...all.map((each) => each.x + NODE.width)) + 9;
      const bottom = Math.max(...all.map((each) => each.y + NODE.height)) + 9;
      return s(
        "g",
        { class: "graph-fused" },
        s("rect", { x: left, y: top, width: right - left, height: bottom - top, rx: 10 }),
        s("text", { x: left + 10, y: top + 14 }, "one kernel"),
      );
    });
}

function edges(nodes, places) {
  return [...nodes.values()].flatMap((each) =>
    each.from
      .filter((name) => places.has(name))
      .map((name) => {
        const [from, to] = [places.get(name), places.get(each.name)];
        const [x1, y1, x2, y2] = [from.x + NODE.width / 2, from.y + NODE.height, to.x + NODE.width / 2, to.y];
        return s("path", {
          class: "graph-edge",
          d: `M${x1} ${y1}C${x1} ${y1 + GAP.y / 2} ${x2} ${y2 - GAP.y / 2} ${x2} ${y2 - 1}`,
          "marker-end": "url(#arrow)",
        });
      }),
  );
}

function node(each, { x, y }, share, told) {
  const words = each.gone
    ? `${each.gone.reason}; changes ${each.gone.bound ? `at most ${short(each.gone.bound)}` : "nothing"}`
    : `${each.operation} by ${each.method}${each.knob === null ? "" : ` at ${setting(each.knob)}`}, ${milliseconds(predicted(each))} predicted`;
  return s(
    "g",
    { class: `graph-node${each.gone ? " gone" : ""}`, transform: `translate(${x} ${y})` },
    s("title", words),
    s("rect", { width: NODE.width, height: NODE.height, rx: 7 }),
    s("text", { x: 11, y: 21, class: "graph-name" }, cut(each.name, 27)),
    s(
      "text",
      { x: 11, y: 38, class: "graph-about" },
      cut(
        each.gone ? each.gone.reason : `${each.method}${each.knob === null ? "" : ` ${setting(each.knob)}`} · ${told}`,
        34,
      ),
    ),
    each.gone
      ? null
      : s("rect", {
          x: 11,
          y: NODE.height - 11,
          width: Math.max(2, (NODE.width - 22) * share),
          height: 4,
          rx: 2,
          class: "graph-time",
        }),
  );
}

const cut = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);
