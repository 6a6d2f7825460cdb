// Status: whether the service is well, what it computes on, what it takes, and what this tab has asked of it.

import { events, json, log, request } from "../lib/api.js";
import { fill, h } from "../lib/dom.js";
import { bytes, milliseconds, short } from "../lib/numbers.js";
import { timeline } from "../parts/account.js";

const EVERY = 3000; // ms

export async function mount(root) {
  const health = h("div", { class: "tiles" });
  const recent = h("div");
  const [version, limits] = await Promise.all([
    json("/v1/version", { quiet: true }),
    json("/v1/limits", { quiet: true }),
  ]);
  const page = h(
    "div",
    { class: "wide-page status" },
    h("h1", "Status"),
    health,
    h(
      "div",
      { class: "columns" },
      h("section", h("h2", "Versions"), table(versions(version))),
      h(
        "section",
        h("h2", "Limits of one request"),
        table(Object.entries(limits).map(([name, value]) => [name.replaceAll("_", " "), limit(name, value)])),
      ),
    ),
    h("section", h("h2", "What this tab asked"), recent),
  );
  fill(root, page);
  const show = () => fill(recent, requests());
  const look = async () => fill(health, await tiles(version));
  show();
  await look();
  const timer = setInterval(look, EVERY);
  events.addEventListener("answered", show);
  return {
    unmount() {
      clearInterval(timer);
      events.removeEventListener("answered", show);
    },
  };
}

const table = (rows) =>
  h(
    "table",
    { class: "plain-table" },
    h(
      "tbody",
      rows.map(([name, value]) => h("tr", h("th", { scope: "row" }, name), h("td", value))),
    ),
  );

function versions({ lichen, python, libraries, opencl }) {
  return [
    ["Lichen", lichen],
    ["Python", python],
    ...Object.entries(libraries).map(([name, value]) => [name, value ?? "–"]),
    ["OpenCL", opencl.available ? opencl.runtime : `not there: ${opencl.reason}`],
  ];
}

function limit(name, value) {
  if (name.endsWith("_bytes") || name === "body_bytes") return bytes(value);
  if (name.includes("bytes_per_second")) return `${bytes(value)}/s`;
  return name.endsWith("seconds") ? `${short(value)} s` : value.toLocaleString("en");
}

const tile = (name, value, note, mood = "") =>
  h(
    "div",
    { class: `tile ${mood}` },
    h("span", { class: "tile-name" }, name),
    h("b", value),
    h("span", { class: "muted" }, note),
  );

async function tiles(version) {
  const began = performance.now();
  const ready = await request("GET", "/readyz", { quiet: true }).then(
    () => null,
    (failure) => failure.detail ?? failure.message,
  );
  const took = performance.now() - began;
  const figures = await request("GET", "/metrics", { quiet: true }).then(
    (response) => response.text(),
    () => "",
  );
  const sum = (name, filter = "") =>
    figures
      .split("\n")
      .filter((line) => line.startsWith(name) && line.includes(filter))
      .reduce((all, line) => all + Number(line.split(" ").pop()), 0);
  const count = sum("lichen_requests_total");
  const waited = sum("lichen_queue_seconds_sum") / Math.max(1, sum("lichen_queue_seconds_count"));
  return [
    ready === null
      ? tile("Ready", "yes", `a tiny request went through in ${milliseconds(took)}`, "good")
      : tile("Ready", "no", ready, "bad"),
    tile(
      "Device",
      version.opencl.available ? "OpenCL" : "NumPy",
      version.opencl.available ? version.opencl.device : version.opencl.reason,
      version.opencl.available ? "good" : "warn",
    ),
    ...(figures
      ? [
          tile(
            "Answered",
            count.toLocaleString("en"),
            `${sum("lichen_problems_total").toLocaleString("en")} of them problems`,
          ),
          tile("Waiting", milliseconds(waited * 1000), "on average, for a thread"),
          tile("Images in memory", bytes(sum("lichen_image_bytes")), "reserved right now"),
          tile("Stored images", bytes(sum("lichen_asset_bytes")), "on disk"),
        ]
      : [tile("Load", "–", "the key in use may not read figures")]),
  ];
}

function requests() {
  if (!log.length) return h("p", { class: "muted" }, "Nothing yet. This list is kept in this tab alone.");
  return h(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": "Requests of this tab" },
    h(
      "table",
      { class: "requests" },
      h(
        "thead",
        h(
          "tr",
          ["time", "request", "status", "where the time went"].map((each) => h("th", { scope: "col" }, each)),
        ),
      ),
      h(
        "tbody",
        log.map((each) =>
          h(
            "tr",
            { class: each.status >= 400 ? "bad" : undefined },
            h("td", each.began.toLocaleTimeString("en-GB")),
            h("td", h("code", { title: each.path }, `${each.method} ${each.path}`)),
            h("td", each.status),
            h("td", each.timing ? timeline(each.timing, each.took) : milliseconds(each.took)),
          ),
        ),
      ),
    ),
  );
}
