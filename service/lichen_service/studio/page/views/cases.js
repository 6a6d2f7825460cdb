// Hard cases: what breaks naive code, shown by running it here and now.

import { json } from "../lib/api.js";
import { fill, h, icon } from "../lib/dom.js";
import { short } from "../lib/numbers.js";
import { Queue, seen } from "../lib/queue.js";
import { link } from "../lib/router.js";

export async function mount(root) {
  const { operations } = await json("/studio/cases/all.json", { quiet: true });
  const families = [...new Set(operations.map((each) => each.family))];
  const list = h("div", { class: "cases" });
  const count = operations.reduce((sum, each) => sum + each.cases.length, 0);
  const queue = new Queue();
  queue.open();
  const watcher = seen(null, (element) => queue.add(element.examine));
  const chips = h(
    "nav",
    { class: "chips", "aria-label": "Families" },
    families.map((name) => h("a", { class: "chip", href: link("cases", name) }, name)),
  );
  const show = (family) => {
    for (const each of chips.children) {
      if (each.textContent === family) each.setAttribute("aria-current", "page");
      else each.removeAttribute("aria-current");
    }
    fill(
      list,
      operations.filter((each) => each.family === family).map((each) => section(each, watcher)),
    );
  };
  fill(
    root,
    h(
      "div",
      { class: "wide-page" },
      h("h1", "Hard cases"),
      h(
        "p",
        { class: "lead" },
        `${count} inputs that break naive code. Each is run by this service as you come to it, and held to what must be true; every method on every backend is held to all of them in the test suite.`,
      ),
      h(
        "p",
        { class: "key-line" },
        h("span", h("i", { class: "swatch nan" }), "NaN"),
        h("span", h("i", { class: "swatch infinite" }), "infinity"),
      ),
      chips,
      list,
    ),
  );
  return {
    open: ({ name }) => show(families.includes(name) ? name : families[0]),
    unmount: () => watcher.disconnect(),
  };
}

function section({ name, cases }, watcher) {
  return h(
    "section",
    { class: "case-group", "aria-label": name },
    h("h2", h("a", { href: link("try", name) }, name)),
    h(
      "div",
      { class: "case-list" },
      cases.map((each, index) => card(name, each, index, watcher)),
    ),
  );
}

function card(operation, { name, why }, index, watcher) {
  const verdict = h("p", { class: "verdict", role: "status" }, "waiting to be run");
  const pictures = h("div", { class: "case-pictures" });
  const does = h("p", { class: "why does" });
  const said = h(
    "details",
    { class: "case-more" },
    h("summary", "Parameters and test"),
    h("p", { class: "muted" }, "not run yet"),
  );
  const element = h(
    "article",
    { class: "case" },
    h("h3", name),
    h("p", { class: "why" }, h("b", "Naive code: "), why),
    does,
    pictures,
    verdict,
    said,
  );
  element.examine = async () => {
    try {
      const found = await json(`/studio/cases/${operation}.${index}.json`, { quiet: true });
      show(found);
    } catch (failure) {
      fill(verdict, failure.detail ?? failure.message);
    }
  };
  watcher.observe(element);
  return element;

  function show(found) {
    const parts = [...Object.entries(found.inputs), ...(found.result ? [["result", found.result]] : [])];
    fill(
      pictures,
      parts.map(
        ([
          part,
          {
            size: [width, height, channels],
            low,
            high,
          },
        ]) =>
          h(
            "figure",
            h("img", {
              src: `/studio/cases/${operation}.${index}.${part}.png`,
              alt: `${part} of the case ${name}`,
              loading: "lazy",
              class: width * height < 16384 ? "pixelated" : undefined,
            }),
            h(
              "figcaption",
              h("b", part),
              ` ${width} × ${height}${channels > 1 ? ` × ${channels}` : ""}`,
              h("br"),
              low === high ? short(low) : `${short(low)} … ${short(high)}`,
            ),
          ),
      ),
    );
    fill(does, found.does ? [h("b", `Lichen, by ${found.method}: `), found.does] : null);
    element.classList.toggle("failed", Boolean(found.wrong));
    fill(
      verdict,
      found.wrong ? icon("cross") : icon("check"),
      found.wrong
        ? `does not hold: ${found.wrong}`
        : `what must be true holds: ${outcome(found)}`,
    );
    fill(
      said,
      h("summary", "Parameters and test"),
      h(
        "pre",
        JSON.stringify(
          found.parameters,
          (_, value) => (typeof value === "number" ? Number(short(value, 6)) || value : value),
          1,
        ).slice(0, 1200),
      ),
      h("p", "Held by ", h("code", found.test)),
    );
  }
}

// What came out, in words.
function outcome({ result: { low, high }, nonfinite, device }) {
  if (!Number.isFinite(low)) return `nothing finite, on ${device}`;
  const values = low === high ? `${short(low)} everywhere` : `${short(low)} to ${short(high)}`;
  const spoilt = nonfinite ? `${nonfinite} ${nonfinite === 1 ? "sample" : "samples"} not finite` : "all finite";
  return `${values}, ${spoilt}, on ${device}`;
}
