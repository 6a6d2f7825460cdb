// What an operation found beside its pixels, as a table; what is nested is told by its path, long lists as a drawing.

import { h, s } from "../lib/dom.js";
import { short } from "../lib/numbers.js";

const LONG = 12;

export function findings(found) {
  const rows = [...flat(found)];
  return h(
    "section",
    { class: "findings" },
    h("h2", "Findings"),
    h(
      "div",
      { class: "scroll", tabindex: 0, role: "region", "aria-label": "Findings" },
      h(
        "table",
        h(
          "tbody",
          rows.map(([path, value]) => h("tr", h("th", { scope: "row" }, path), h("td", shown(value)))),
        ),
      ),
    ),
  );
}

function* flat(value, path = "") {
  const object = value !== null && typeof value === "object" && !Array.isArray(value);
  if (!object) return yield* listed(value, path);
  for (const [name, each] of Object.entries(value)) yield* flat(each, path ? `${path} ${name}` : name);
}

// A few things of the same kind are told side by side: "channels mean" has a value for each channel.
function* listed(value, path) {
  const alike =
    Array.isArray(value) &&
    value.length > 0 &&
    value.length <= LONG &&
    value.every((each) => each !== null && typeof each === "object" && !Array.isArray(each));
  if (!alike) return yield [path, value];
  const names = [...new Set(value.flatMap((each) => Object.keys(each)))];
  for (const name of names) yield [`${path} ${name}`, value.map((each) => each[name])];
}

function shown(value) {
  if (Array.isArray(value) && value.some((each) => Array.isArray(each) && each.length > LONG)) return value.map(shown);
  if (Array.isArray(value)) {
    const numbers = value.every((each) => typeof each === "number");
    if (numbers && value.length > LONG) return bars(value);
    return value.length > LONG
      ? `${value.length} entries`
      : value.map((each) => (typeof each === "object" ? JSON.stringify(each) : text(each))).join("  ");
  }
  return text(value);
}

const text = (value) =>
  typeof value === "number"
    ? Number.isInteger(value)
      ? String(value)
      : short(value, 5)
    : value === null
      ? "–"
      : String(value);

function bars(values) {
  const most = Math.max(...values, 1e-30);
  return s(
    "svg",
    {
      class: "bars",
      viewBox: `0 0 ${values.length} 40`,
      preserveAspectRatio: "none",
      role: "img",
      "aria-label": `${values.length} values, the largest ${short(most)}`,
    },
    s("path", { d: values.map((each, i) => `M${i} 40V${40 - (40 * Math.max(each, 0)) / most}h1V40z`).join("") }),
  );
}
