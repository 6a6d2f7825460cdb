// A slider for every number of a scene's lens, fog and lights.

import { h } from "../lib/dom.js";
import { controlFor } from "./controls.js";

const AXES = ["x", "y", "z"];
const MOST = 16;
const CALLED = { "lens blur": "lens aperture" }; // how wide it is: what it blurs what is far away by, px

// Nothing where the text is no JSON. `turned(scene)` hears of every change.
export function dials(text, turned) {
  let scene;
  try {
    scene = JSON.parse(text);
  } catch {
    return null;
  }
  const found = ["lens", "fog", "lights"].flatMap((each) => [...numbers(scene[each] ?? {}, [each])]).slice(0, MOST);
  return found.map(({ path, value }) => {
    const label = named(path);
    const made = controlFor(range(path, value), {
      label,
      value,
      changed: (now) => {
        put(scene, path, now);
        turned(scene);
      },
    });
    const field = made.element.querySelector(".number");
    field?.setAttribute("aria-label", label);
    return h("div", { class: "dial" }, h("span", { class: "name" }, label), made.element);
  });
}

// Places and brightnesses; colours and how shadows are sampled are left to the text.
function* numbers(value, path) {
  const name = path.at(-1);
  if (typeof value === "number") yield { path, value };
  else if (name !== "colour" && name !== "shadow" && value !== null && typeof value === "object") {
    for (const [key, each] of Object.entries(value)) yield* numbers(each, [...path, key]);
  }
}

function range(path, value) {
  const placed = AXES[path.at(-1)] && path.length > 3;
  const reach = Math.max(6, 2 * Math.abs(value));
  return placed
    ? { kind: "number", low: -reach, high: reach }
    : { kind: "number", low: 0, high: Math.max(4 * Math.abs(value), path[0] === "lens" ? 24 : 1) };
}

function named(path) {
  const [first, ...rest] = path;
  const words = first === "lights" ? [`light ${Number(rest.shift()) + 1}`] : [first];
  const name = [...words, ...rest.map((each, i) => (i > 0 ? (AXES[each] ?? each) : each))].join(" ");
  return CALLED[name] ?? name;
}

function put(scene, path, value) {
  const last = path.at(-1);
  let place = scene;
  for (const each of path.slice(0, -1)) place = place[each];
  place[last] = value;
}
