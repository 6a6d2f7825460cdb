// Try an operation: catalogue, pictures, result and parameters beside one another.

import { events, json } from "../lib/api.js";
import { fill, h, icon } from "../lib/dom.js";
import { judged, settings } from "../lib/front.js";
import { Order } from "../lib/order.js";
import { link, say } from "../lib/router.js";
import { asFloats, explain, run, settingOf } from "../lib/run.js";
import { Runner } from "../lib/runner.js";
import { sample, showcase } from "../lib/samples.js";
import { fromText } from "../lib/schema.js";
import { account, measuredOf } from "../parts/account.js";
import { catalogue } from "../parts/catalogue.js";
import { findings } from "../parts/findings.js";
import { form } from "../parts/form.js";
import { inputs } from "../parts/inputs.js";
import { price } from "../parts/price.js";
import { problem } from "../parts/problem.js";
import { stage } from "../parts/stage.js";
import { use } from "../parts/use.js";

const FIRST = "gaussian"; // what is open when nothing was asked for
// What a visitor who knows nothing of this can do at once.
const STARTS = [
  ["lic", "Draw a flow"],
  ["perlin_noise", "Make clouds"],
  ["curve", "Bend a tone curve"],
];
const SLOW = 8; // ms from which a cheap version while dragging is worth its loss
const SEEN = 0.02; // an error up to which such a version still looks like the result,
const MOVING = 4; // and how many times the error in use is not noticed while the picture moves

export async function mount(root) {
  const [{ operations }, shown] = await Promise.all([json("/v1/operations", { quiet: true }), showcase()]);
  return new Try(root, operations, shown);
}

class Try {
  #order = null;
  #plan = null;
  #verify = false;
  #own = null; // the picture that the visitor brought
  #probing = null;
  #opened = 0;

  constructor(root, operations, shown) {
    Object.assign(this, { root, operations, shown });
    this.catalogue = catalogue(operations, { chosen: () => this.#side(false) });
    this.trouble = h("div", { class: "trouble" });
    this.stage = stage({ probed: () => this.#probe(), over: this.trouble });
    this.price = price({
      choose: (wishes) => this.#wish(wishes),
      measure: (on) => this.#measure(on),
      opacity: (opacity) => this.stage.show({ opacity }),
    });
    this.use = use({ formats: shown.formats, failed: (failure) => this.#fail(failure) });
    this.runner = new Runner({
      send: ({ order, preview, verify }, signal) => run(order, { signal, preview, verify }),
      settled: (result, order) => this.#settle(result, order),
      failed: (failure) => this.#fail(failure),
      busy: (on) => this.stage.busy(on),
    });
    this.starts = h(
      "nav",
      { class: "starts", "aria-label": "First steps", hidden: true },
      h("span", { class: "muted" }, "New here? Drop a picture anywhere, or:"),
      STARTS.map(([name, words]) => h("a", { class: "chip", href: link("try", name) }, words)),
    );
    this.head = h("header", { class: "work-head" });
    this.inputs = h("div");
    this.account = h("div", { class: "account-slot" });
    this.found = h("div");
    this.form = h("div");
    this.theory = h("div");
    this.toggle = h(
      "button",
      {
        type: "button",
        class: "plain side-toggle",
        "aria-expanded": "false",
        "aria-controls": "side",
        onclick: () => this.#side(!this.side.classList.contains("open")),
      },
      icon("menu"),
      "All operations",
    );
    this.side = h("aside", { class: "side", id: "side", "aria-label": "Operations" }, this.catalogue.element);
    this.panel = h(
      "aside",
      { class: "panel", "aria-label": "Parameters and accuracy" },
      h(
        "section",
        { "aria-labelledby": "parameters-title" },
        h("h2", { id: "parameters-title" }, "Parameters"),
        this.form,
      ),
      this.price.element,
    );
    const work = h(
      "section",
      { class: "work", "aria-label": "Result" },
      this.toggle,
      this.starts,
      this.head,
      this.inputs,
      this.stage.element,
      this.account,
      this.found,
      this.use.element,
      this.theory,
    );
    this.frame = h("div", { class: "try fresh" }, this.side, work, this.panel);
    fill(root, this.frame);
    this.listeners = [
      [events, "found", () => this.#again()],
      [document, "paste", (event) => this.#paste(event)],
      [document, "dragover", (event) => event.preventDefault()],
      [document, "drop", (event) => this.#drop(event)],
    ];
    for (const [target, name, act] of this.listeners) target.addEventListener(name, act);
  }

  unmount() {
    this.runner.stop();
    this.stage.stop();
    for (const [target, name, act] of this.listeners) target.removeEventListener(name, act);
  }

  async open({ name, query }) {
    const wanted = name || this.#order?.name || FIRST;
    const opened = (this.#opened += 1);
    this.catalogue.mark(wanted);
    this.starts.hidden = Boolean(this.#order || (name && name !== FIRST));
    try {
      const described = await json(`/v1/operations/${encodeURIComponent(wanted)}`, { quiet: true });
      const given = await this.#pictures(described);
      if (opened !== this.#opened) return;
      this.#begin(described, given, query);
    } catch (failure) {
      this.#fail(failure);
    }
  }

  // The visitor's own picture for the first input that is one, samples for the others.
  async #pictures(described) {
    const said = this.shown.operations[described.name]?.inputs ?? {};
    const first = described.inputs.find((each) => each.picture && each.required);
    const given = {};
    await Promise.all(
      described.inputs.map(async ({ name }) => {
        if (this.#own && name === first?.name) given[name] = this.#own;
        else if (said[name]) given[name] = await sample(said[name]);
      }),
    );
    return Object.fromEntries(
      described.inputs.filter(({ name }) => given[name]).map(({ name }) => [name, given[name]]),
    );
  }

  #begin(described, given, query) {
    const properties = described.parameters.properties ?? {};
    const values = query.length ? {} : { ...this.shown.operations[described.name]?.parameters };
    const wishes = {};
    for (const [name, text] of query) {
      if (name in properties) values[name] = fromText(properties[name], text);
      else wishes[name] = fromText({}, text);
    }
    this.#order = new Order(described, { values, wishes, inputs: given });
    Object.assign(this, { report: null, used: null });
    this.#plan = null;
    this.#verify = false;
    this.price.reset(false);
    this.price.clear();
    fill(this.trouble);
    this.stage.show({ result: null, input: null, overlay: null, floats: null, inputFloats: null });
    fill(this.account);
    fill(this.found);
    document.title = `${described.name} · Lichen`;
    fill(
      this.head,
      h("div", h("h1", described.name), h("span", { class: "family" }, described.family)),
      h("p", described.summary),
    );
    fill(this.theory, about(described));
    this.#shape();
    this.#inputs();
    this.frame.classList.remove("fresh");
    this.#ask();
    json(`/v1/accuracy/${described.name}`, { quiet: true }).then(
      (report) => {
        if (this.#order?.name !== described.name) return;
        this.report = report;
        this.price.about(report, this.used);
      },
      () => {},
    );
  }

  #shape() {
    const { parameters = {}, order = [] } = this.shown.operations[this.#order.name] ?? {};
    this.fields = form(this.#order, {
      first: Object.keys(parameters),
      sequence: order,
      changed: (name, value, dragging) => this.#change(name, value, dragging),
    });
    fill(this.form, this.fields.element);
  }

  #inputs() {
    const order = this.#order;
    this.drops = inputs(order.described.inputs, order.inputs, {
      changed: (name, picture) => this.#take(name, picture),
      failed: (failure) => this.#fail(failure),
    });
    fill(this.inputs, this.drops.element);
    const first = Object.values(order.inputs)[0];
    this.stage.show({ input: null, inputFloats: null });
    first
      ?.look()
      .then((input) => {
        if (this.#order.inputs === order.inputs) this.stage.show({ input });
      })
      .catch((failure) => this.#fail(failure));
  }

  #take(name, picture) {
    const { described, inputs: before } = this.#order;
    if (picture && !picture.sample && described.inputs.find((each) => each.name === name)?.picture) this.#own = picture;
    const all = { ...before, [name]: picture };
    const ordered = Object.fromEntries(
      described.inputs.filter((each) => all[each.name]).map((each) => [each.name, all[each.name]]),
    );
    this.#order = this.#order.copy({ inputs: ordered });
    this.#inputs();
    this.#ask();
  }

  #change(name, value, dragging) {
    const values = { ...this.#order.values, [name]: value };
    if (value === undefined) delete values[name];
    this.#order = this.#order.copy({ values });
    this.#ask(dragging);
  }

  #wish(wishes) {
    const kept = Object.entries(this.#order.wishes).filter(([name]) => !this.#chosen(name));
    this.#order = this.#order.copy({ wishes: { ...Object.fromEntries(kept), ...wishes } });
    this.#ask();
  }

  // Whether a wish says how the operation is computed.
  #chosen(name) {
    return (
      ["method", "max_error", "max_ms"].includes(name) ||
      this.#order.described.methods.some((each) => each.knob?.name === name)
    );
  }

  #measure(on) {
    this.#verify = on;
    this.#ask();
  }

  #again() {
    if (this.#order) this.#ask();
  }

  #ask(dragging = false) {
    const order = this.#order;
    say("try", order.name, order.query());
    const missing = order.missing();
    if (missing.length) {
      this.runner.stop();
      return this.stage.say(h("p", `Drop a picture for ${missing.join(" and ")}.`));
    }
    if (!dragging) this.use.show(order);
    this.runner.ask({
      order,
      preview: dragging ? (this.#cheap() ?? order.wishes) : null,
      verify: !dragging && this.#verify,
    });
    return undefined;
  }

  // What is run while a slider is dragged: the fastest setting whose error is hardly seen, where that saves anything.
  #cheap() {
    const node = this.#plan?.nodes.find((each) => each.operation === this.#order.name);
    const { points } = judged(settings(node, this.used ?? undefined));
    const inUse = points.find((each) => each.chosen);
    if (!inUse || inUse.ms < SLOW) return null;
    const fast = points
      .filter((each) => each.error <= Math.max(SEEN, MOVING * inUse.error))
      .sort((a, b) => a.ms - b.ms)[0];
    if (!fast || fast.ms > 0.7 * inUse.ms) return null;
    const knob = this.#order.described.methods.find((each) => each.name === fast.method)?.knob;
    return { method: fast.method, ...(knob && fast.knob !== null ? { [knob.name]: fast.knob } : {}) };
  }

  #settle(result, { order, preview }) {
    if (order.described !== this.#order.described) return;
    fill(this.trouble);
    this.fields.blame([]);
    this.catalogue.draw();
    this.result = result;
    this.#probing = null;
    this.stage.say(null);
    this.stage.show({ result: result.look, overlay: preview ? null : result.map, floats: null });
    fill(this.account, account(result.headers, result.took));
    this.account.classList.toggle("previewing", Boolean(preview));
    if (preview) return;
    fill(this.found, result.findings ? findings(result.findings) : null);
    if (this.#verify) this.price.measured(measuredOf(result.headers), result.map ? result.scale : null);
    this.used = settingOf(result.headers);
    this.#explain(order);
  }

  async #explain(order) {
    try {
      const plan = await explain(order);
      if (order !== this.#order) return;
      this.#plan = plan;
      this.price.show(plan, order, this.used, this.result?.facts.space);
      this.price.about(this.report, this.used);
    } catch (failure) {
      if (order === this.#order) this.#fail(failure);
    }
  }

  // The floats are fetched when somebody points at a pixel.
  async #probe() {
    const { result } = this;
    if (!result || this.#probing === result || result.preview) return;
    this.#probing = result;
    try {
      const order = this.#order;
      const picture = result.picture.blob.type === "application/x-npy" ? result.picture : await asFloats(order);
      const floats = await picture.floats();
      if (this.result === result) this.stage.show({ floats });
      const first = Object.values(order.inputs)[0];
      if (!first) return;
      const inputFloats = await first.floats();
      if (this.result === result && this.#order.inputs === order.inputs) this.stage.show({ inputFloats });
    } catch (failure) {
      if (this.result === result) this.#fail(failure);
    }
  }

  #fail(failure) {
    this.frame.classList.remove("fresh");
    const left = this.fields ? this.fields.blame(failure.errors ?? []) : failure.errors;
    fill(this.trouble, problem(failure, left));
    this.catalogue.draw();
    this.stage.busy(false);
  }

  #paste(event) {
    const file = [...(event.clipboardData?.files ?? [])][0];
    if (file) this.drops?.take(file);
  }

  #drop(event) {
    event.preventDefault();
    if (event.dataTransfer?.files[0]) this.drops?.take(event.dataTransfer.files[0]);
  }

  #side(open) {
    this.side.classList.toggle("open", open);
    this.toggle.setAttribute("aria-expanded", String(open));
    if (open) this.catalogue.focus();
  }
}

function about(described) {
  const text = described.description.trim();
  if (!text) return null;
  return h(
    "details",
    { class: "theory" },
    h("summary", `Definition, methods and sources of ${described.name}`),
    h("pre", text),
    h(
      "ul",
      described.methods.map((each) => h("li", h("code", each.name), ` ${each.description}`)),
    ),
  );
}
