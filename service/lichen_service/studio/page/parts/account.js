// How a result was made, from the headers of the answer: method, device, error, what was left out, where the time went.

import { stages } from "../lib/api.js";
import { h } from "../lib/dom.js";
import { milliseconds, short } from "../lib/numbers.js";

// { value, kind } from "1.23e-05; bound; max".
export function errorOf(headers) {
  const [value, kind] = (headers.get("Lichen-Error") ?? "").split(";").map((each) => each.trim());
  return value ? { value: Number(value), kind } : null;
}

// { largest, p999, rms, sampled, reason } from Lichen-Measured.
export function measuredOf(headers) {
  const text = headers.get("Lichen-Measured");
  if (!text) return null;
  const number = (name) => Number(new RegExp(`${name}=([^;]+)`).exec(text)?.[1] ?? NaN);
  if (text.startsWith("none")) return { reason: /reason="(.*)"/.exec(text)?.[1] ?? "" };
  return { largest: Number(text.split(";")[0]), p999: number("p999"), rms: number("rms"), sampled: number("sampled") };
}

// [{ pass, node, reason, bound }] from Lichen-Skipped.
export function skippedOf(headers) {
  const text = headers.get("Lichen-Skipped") ?? "";
  return [...text.matchAll(/([\w.-]+);node="((?:[^"\\]|\\.)*)";reason="((?:[^"\\]|\\.)*)";bound=([^,\s]+)/g)].map(
    ([, pass, node, reason, bound]) => ({ pass, node, reason: reason.replaceAll("\\", ""), bound: Number(bound) }),
  );
}

const KINDS = { bound: "at most, proved", estimate: "at most, as found on a corpus", measured: "as measured" };

export function account(headers, took) {
  const error = errorOf(headers);
  const skipped = skippedOf(headers);
  const nonfinite = Number(headers.get("Lichen-Nonfinite") ?? 0);
  const facts = [
    ["method", h("code", headers.get("Lichen-Method") ?? "")],
    ["device", headers.get("Lichen-Device") ?? ""],
    error && ["error", h("span", { title: KINDS[error.kind] }, h("b", short(error.value)), ` ${error.kind}`)],
    nonfinite && ["not finite", `${nonfinite} samples`],
  ].filter(Boolean);
  return h(
    "div",
    { class: "account" },
    h(
      "dl",
      { class: "facts" },
      facts.map(([name, value]) => h("div", h("dt", name), h("dd", value))),
    ),
    timeline(headers.get("Server-Timing"), took),
    skipped.length
      ? h("p", { class: "skipped" }, `Left out: ${skipped.map((each) => `${each.node} (${each.reason})`).join("; ")}.`)
      : null,
  );
}

const COLOURED = new Set(["queue", "decode", "plan", "upload", "kernel", "download", "encode"]);
const part = (name) => `part-${COLOURED.has(name) ? name : "other"}`;

// Where the time went, as one bar; `took` is what the browser waited in all.
export function timeline(header, took) {
  const all = stages(header);
  const total = all.find(([name]) => name === "total")?.[1] ?? 0;
  const parts = all.filter(([name, time]) => name !== "total" && !name.startsWith("kernel.") && time > 0); // those are parts of kernel
  const sum =
    Math.max(
      total,
      parts.reduce((before, [, time]) => before + time, 0),
    ) || 1;
  const bar = h(
    "div",
    {
      class: "timeline",
      role: "img",
      "aria-label": parts.map(([name, time]) => `${name} ${milliseconds(time)}`).join(", "),
    },
    parts.map(([name, time]) => {
      const piece = h("span", { class: `stage-part ${part(name)}`, title: `${name} ${milliseconds(time)}` });
      piece.style.setProperty("flex-grow", time / sum);
      return piece;
    }),
  );
  const nodes = all.filter(([name, time]) => name.startsWith("kernel.") && time > 0);
  const longest = [...parts].sort((a, b) => b[1] - a[1]).slice(0, 3);
  const words = longest.map(([name, time]) =>
    h("span", h("i", { class: `dot ${part(name)}` }), `${name} ${milliseconds(time)}`),
  );
  return h(
    "div",
    { class: "time" },
    bar,
    nodes.length > 1 ? flame(parts, nodes, sum) : null,
    h(
      "p",
      { class: "time-words" },
      h("b", milliseconds(total)),
      words,
      parts.some(([name]) => name === "kernel") ? null : h("span", { class: "muted" }, "kept from an earlier run"),
      took ? h("span", { class: "muted" }, `here ${milliseconds(took)}`) : null,
    ),
  );
}

// Below the kernels' piece of the bar: the nodes that share it.
function flame(parts, nodes, sum) {
  const before = parts.slice(0, parts.findIndex(([name]) => name === "kernel"));
  const gone = before.reduce((all, [, time]) => all + time, 0);
  const pieces = nodes.map(([name, time]) => {
    const node = name.slice("kernel.".length);
    const piece = h("span", { class: "flame-part", title: `${node} ${milliseconds(time)}` }, node);
    piece.style.setProperty("flex-grow", time / sum);
    return piece;
  });
  const gap = (share) => {
    const element = h("span", { class: "flame-gap" });
    element.style.setProperty("flex-grow", Math.max(0, share));
    return element;
  };
  const used = nodes.reduce((all, [, time]) => all + time, 0);
  return h(
    "div",
    {
      class: "flame",
      role: "img",
      "aria-label": nodes.map(([name, time]) => `${name.slice("kernel.".length)} ${milliseconds(time)}`).join(", "),
    },
    gap(gone / sum),
    pieces,
    gap((sum - gone - used) / sum),
  );
}
