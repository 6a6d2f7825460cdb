// What accuracy costs here, for these parameters and this picture: the plot, a slider along its front, a sentence on what
// ten times more would cost, and the error as measured against truth, with its map.

import { fill, h } from "../lib/dom.js";
import { front, judged, meaning, named, settings, tenfold } from "../lib/front.js";
import { milliseconds, short } from "../lib/numbers.js";
import { plot } from "./plot.js";

// `choose(wishes)` asks for another setting: { method, KNOB } or { max_error } or {}. `measure(on)` asks for verification.
export function price({ choose, measure, opacity }) {
  const plotted = h("div", { class: "price-plot" });
  const words = h("p", { class: "price-words" });
  const scale = h("p", { class: "muted price-scale" });
  const walk = h("div", { class: "walk" });
  const corpus = h("p", { class: "muted corpus" });
  const verify = h("input", {
    type: "checkbox",
    class: "switch",
    role: "switch",
    id: "measure",
    onchange: () => measure(verify.checked),
  });
  const measured = h("div", { class: "measured" });
  const element = h(
    "section",
    { class: "price", "aria-labelledby": "price-title" },
    h("h2", { id: "price-title" }, "What accuracy costs"),
    words,
    scale,
    plotted,
    walk,
    corpus,
    h("div", { class: "measure" }, verify, h("label", { for: "measure" }, "Measure the error on this picture")),
    measured,
  );

  // `plan` as the service explained it; `order` is what was asked, `used` the setting that ran, `space` what its result is.
  function show(plan, order, used, space) {
    const node = plan.nodes.find((each) => each.operation === order.name);
    if (!node) {
      fill(plotted);
      fill(walk);
      const why = plan.decisions.find((each) => each.action === "dropped" || each.action === "skipped");
      fill(scale);
      words.textContent = `Nothing is computed: ${why ? why.reason : "the result is the input"}. It is exact and costs nothing.`;
      return;
    }
    const { by, points } = judged(settings(node, used));
    for (const each of points) each.by = by;
    const inUse = points.find((each) => each.chosen);
    const knobs = Object.fromEntries(
      order.described.methods.filter((each) => each.knob).map((each) => [each.name, each.knob.name]),
    );
    const run = (point) =>
      choose({
        method: point.method,
        ...(point.knob !== null && knobs[point.method] ? { [knobs[point.method]]: point.knob } : {}),
      });
    element.classList.toggle("untraded", points.length < 2);
    if (points.length < 2) {
      fill(plotted);
      fill(walk);
      fill(scale);
      words.textContent = inUse
        ? `There is one way to compute this, ${named(inUse)}: ${inUse.error ? `an error of ${short(inUse.error)} at most` : "without any error"}, in ${milliseconds(inUse.ms)}. Nothing to trade.`
        : "No setting can be judged for this picture.";
      return;
    }
    fill(
      plotted,
      points.length
        ? plot(points, { by, wanted: by === "stated" ? order.wishes.max_error : undefined, chosen: run })
        : null,
    );
    const said = tenfold(points, inUse);
    fill(
      words,
      said ? said.text : "",
      said?.point ? h("button", { type: "button", class: "link", onclick: () => run(said.point) }, "Run it") : null,
    );
    scale.textContent =
      space === "data"
        ? "Errors are in the units of the result, which is data and no picture."
        : meaning(by === "stated" ? inUse?.error : undefined);
    if (by === "typical" && inUse)
      scale.textContent += ` All settings state much the same largest error, ${short(inUse.stated)}; what they are compared by is the typical one (RMS).`;
    stroll(points, inUse, by, order, run);
  }

  // The slider from the fastest setting of the front to the most accurate one.
  function stroll(points, inUse, by, order, run) {
    const along = front(points);
    const automatic = order.wishes.method === undefined && order.wishes.max_error === undefined;
    const reset = h(
      "button",
      { type: "button", class: "link", hidden: automatic, onclick: () => choose({}) },
      "leave it to the service",
    );
    if (along.length < 2) {
      fill(walk, automatic ? null : reset);
      return;
    }
    const at = Math.max(
      0,
      along.findIndex((each) => each.error <= (inUse?.error ?? 0)),
    );
    const slider = h("input", {
      type: "range",
      min: 0,
      max: along.length - 1,
      step: 1,
      value: at,
      class: "slider",
      id: "max-error",
    });
    const text = h("output", { for: "max-error" });
    const tell = () => {
      const point = along[slider.value];
      text.textContent = `${by === "typical" ? "typical" : "at most"} ${short(point.error)}, ${milliseconds(point.ms)}`;
      slider.setAttribute("aria-valuetext", `${text.textContent}, ${named(point)}`);
      slider.style.setProperty("--filled", `${(100 * slider.value) / (along.length - 1)}%`);
    };
    slider.addEventListener("input", tell);
    slider.addEventListener("change", () => {
      const point = along[slider.value];
      // Rounded up, so that the setting itself still meets what is asked.
      if (by === "stated" && point.error > 0) choose({ max_error: Number((point.error * 1.0005).toPrecision(4)) });
      else run(point);
    });
    tell();
    fill(
      walk,
      h(
        "div",
        { class: "walk-head" },
        h("label", { for: "max-error" }, by === "typical" ? "accuracy" : "max_error"),
        text,
        reset,
      ),
      slider,
      h("div", { class: "walk-ends" }, h("span", "fastest"), h("span", "most accurate")),
    );
  }

  return {
    element,
    show,
    // What the corpus showed of the setting in use, from the service's report of this operation.
    about(report, used) {
      const found =
        used &&
        report?.settings.find(
          (each) =>
            each.method === used.method && (each.knob === used.knob || Math.abs(each.knob / used.knob - 1) < 1e-4),
        );
      if (!report) return;
      const words =
        found && Number.isFinite(found.worst) && found.worst !== null
          ? `On the corpus of test pictures ${named(found)} was off by ${short(found.worst)} at worst and ${short(found.typical)} as a rule (RMS). ${report.headline}`
          : report.headline;
      fill(corpus, words, " ", h("a", { href: `/v1/accuracy/${report.operation}.svg` }, "The whole report"));
    },
    measured(found, scale) {
      if (!found) return fill(measured);
      if (found.reason !== undefined) return fill(measured, h("p", `It cannot be measured: ${found.reason}.`));
      return fill(
        measured,
        h(
          "dl",
          { class: "facts" },
          [
            ["largest", found.largest],
            ["99.9 %", found.p999],
            ["RMS", found.rms],
          ].map(([name, value]) => h("div", h("dt", name), h("dd", h("b", short(value))))),
        ),
        scale ? colourBar(scale, opacity) : null,
        found.sampled < 1
          ? h("p", { class: "muted" }, `Compared on ${short(found.sampled * 100)} % of the pixels.`)
          : null,
      );
    },
    // Another operation: nothing is known yet.
    clear() {
      for (const each of [plotted, words, scale, walk, corpus]) fill(each);
      element.classList.remove("untraded");
    },
    reset(on) {
      verify.checked = on;
      if (!on) fill(measured);
    },
  };
}

// The scale of the map, and how strongly it lies over the picture.
function colourBar({ low, high }, opacity) {
  const slider = h("input", {
    type: "range",
    min: 0,
    max: 100,
    value: 85,
    class: "slider",
    id: "map-opacity",
    oninput: () => opacity(Number(slider.value) / 100),
  });
  slider.style.setProperty("--filled", "85%");
  slider.addEventListener("input", () => slider.style.setProperty("--filled", `${slider.value}%`));
  return h(
    "div",
    { class: "colour-bar" },
    h("div", { class: "bar", role: "img", "aria-label": `Errors from ${short(low)}, dark, to ${short(high)}, light` }),
    h("div", { class: "walk-ends" }, h("span", short(low)), h("span", "error of each pixel"), h("span", short(high))),
    h("div", { class: "map-opacity" }, h("label", { for: "map-opacity" }, "map over the picture"), slider),
  );
}
