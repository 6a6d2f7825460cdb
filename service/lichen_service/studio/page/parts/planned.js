// What is planned as a whole, a pipeline or a scene: text in, the graph that is planned for it out, with what was fused,
// dropped and why, and the picture it makes.

import { events, request, stages } from "../lib/api.js";
import { fill, h } from "../lib/dom.js";
import { milliseconds, short } from "../lib/numbers.js";
import { read } from "../lib/npy.js";
import { Picture, factsOf } from "../lib/picture.js";
import { say } from "../lib/router.js";
import { SEEN } from "../lib/run.js";
import { sample } from "../lib/samples.js";
import { account, errorOf } from "../parts/account.js";
import { graph } from "../parts/graph.js";
import { inputs } from "../parts/inputs.js";
import { apart, tiles } from "../parts/over.js";
import { problem } from "../parts/problem.js";
import { stage } from "../parts/stage.js";

// `kind` says what is written and how it is sent: { name, path, title, label, lead, hint, rows, text(preset),
// sent(text, given), dials, tiled }.
export class Planned {
  #given = {};
  #run = 0;
  #going = new AbortController(); // what was asked last; anything newer stops it

  constructor(root, presets, kind) {
    this.presets = presets;
    this.kind = kind;
    this.text = h("textarea", {
      class: "wide code",
      id: "pipeline",
      rows: kind.rows,
      spellcheck: "false",
      autocapitalize: "off",
    });
    this.text.addEventListener("change", () => {
      this.#turn();
      this.#go();
    });
    this.text.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) this.#go();
    });
    this.all = h("input", {
      type: "checkbox",
      class: "switch",
      role: "switch",
      id: "run-all",
      onchange: () => this.#go(),
    });
    this.error = h("input", {
      type: "number",
      step: "any",
      min: 0,
      id: "pipeline-error",
      class: "number",
      placeholder: "none",
      onchange: () => this.#go(),
    });
    this.tiles = h("input", {
      type: "checkbox",
      class: "switch",
      role: "switch",
      id: "over-tiles",
      onchange: () => this.#map(),
    });
    this.mapped = h("p", { class: "mapped", role: "status" });
    this.proof = h("p", { class: "proof", role: "status" });
    this.inputs = h("div");
    this.dials = h("div", { class: "dials" });
    this.trouble = h("div");
    this.graph = h("div", { class: "graph-slot" });
    this.decisions = h("div");
    this.account = h("div");
    this.stage = stage({ probed: () => this.#probe() });
    const chips = h(
      "div",
      { class: "chips", role: "group", "aria-label": "Examples" },
      presets.map((each) => h("button", { type: "button", class: "chip", onclick: () => this.#set(each) }, each.title)),
    );
    const seen = [this.trouble, this.stage.element, this.account]; // beside the dials, where there are some
    fill(
      root,
      h(
        "div",
        { class: "pipelines" },
        h(
          "section",
          { class: "pipeline-side", "aria-label": kind.label },
          h("h1", kind.title),
          h("p", { class: "lead" }, kind.lead),
          chips,
          this.dials,
          kind.dials ? seen : null,
          h("label", { for: "pipeline", class: "name" }, kind.label),
          this.text,
          h("p", { class: "muted" }, kind.hint),
          h(
            "div",
            { class: "wishes" },
            h("label", { for: "pipeline-error" }, "max_error"),
            this.error,
            h("span", { class: "pair" }, this.all, h("label", { for: "run-all" }, "run everything (prune=false)")),
            kind.tiled
              ? h("span", { class: "pair" }, this.tiles, h("label", { for: "over-tiles" }, "show lights per tile"))
              : null,
            h(
              "button",
              { type: "button", class: "plain", onclick: () => this.#prove() },
              "Compare with everything run",
            ),
            h("button", { type: "button", class: "main", onclick: () => this.#go() }, "Run"),
          ),
          this.mapped,
          this.proof,
          this.inputs,
          kind.dials ? null : seen,
        ),
        h(
          "section",
          { class: "pipeline-plan", "aria-labelledby": "plan-title" },
          h("h2", { id: "plan-title" }, "The plan"),
          this.graph,
          this.decisions,
        ),
      ),
    );
    this.listeners = [
      [events, "found", () => this.#go()],
      [document, "paste", (event) => this.#own(event, event.clipboardData)],
      [document, "dragover", (event) => event.preventDefault()],
      [document, "drop", (event) => this.#own(event, event.dataTransfer)],
    ];
    for (const [target, name, act] of this.listeners) target.addEventListener(name, act);
  }

  unmount() {
    this.#going.abort();
    this.stage.stop();
    for (const [target, name, act] of this.listeners) target.removeEventListener(name, act);
  }

  // A picture that was let go of anywhere, or pasted, is the first that is read.
  #own(event, transfer) {
    if (!transfer?.files[0]) return;
    event.preventDefault();
    this.drops?.take(transfer.files[0]);
  }

  async open({ query }) {
    const said = Object.fromEntries(query);
    if (said.pipeline && said.pipeline === this.text.value) return;
    const given = said.pipeline && { pipeline: said.pipeline, inputs: { image: "portrait" } };
    await this.#set(
      this.presets.find((each) => each.pipeline && each.pipeline === said.pipeline) ?? given ?? this.presets[0],
    );
  }

  async #set(preset) {
    this.text.value = this.kind.text(preset);
    this.#turn();
    this.error.value = preset.max_error ?? "";
    this.all.checked = false;
    try {
      this.#given = Object.fromEntries(
        await Promise.all(Object.entries(preset.inputs ?? {}).map(async ([name, each]) => [name, await sample(each)])),
      );
      this.#fields();
      await this.#go();
    } catch (failure) {
      this.#fail(failure);
    }
  }

  #fields() {
    const declared = Object.keys(this.#given).map((name) => ({
      name,
      required: true,
      description: `what the pipeline reads as input.${name}`,
    }));
    const made = inputs(declared, this.#given, {
      changed: (name, picture) => {
        this.#given = { ...this.#given, [name]: picture };
        this.#fields();
        this.#go();
      },
      failed: (failure) => this.#fail(failure),
    });
    this.drops = declared.length ? made : null;
    fill(this.inputs, declared.length ? made.element : null);
  }

  // The dials of what the text says; one that is turned writes it anew.
  #turn() {
    fill(
      this.dials,
      this.kind.dials?.(this.text.value, (text) => {
        this.text.value = text;
        this.#soon();
      }),
    );
  }

  // While a dial is dragged: one run at a time, and then the newest.
  async #soon() {
    this.waiting = true;
    if (this.turning) return;
    this.turning = true;
    while (this.waiting) {
      this.waiting = false;
      await this.#go();
    }
    this.turning = false;
  }

  #ask(further, { headers = { Accept: SEEN }, quiet = false, all = this.all.checked, signal } = {}) {
    const sent = this.kind.sent(this.text.value.trim(), this.#given);
    const query = [
      ...sent.query,
      ...(this.error.value ? [["max_error", this.error.value]] : []),
      ...(all ? [["prune", "false"]] : []),
      ...further,
    ];
    return request("POST", this.kind.path, {
      query,
      headers: { ...headers, ...sent.headers },
      quiet,
      signal,
      body: sent.body,
    });
  }

  async #go() {
    const mine = (this.#run += 1);
    this.#going.abort();
    this.#going = new AbortController();
    const { signal } = this.#going;
    say(this.kind.name, "", this.kind.sent(this.text.value.trim(), {}).query);
    this.stage.busy(true);
    try {
      const plan = await (await this.#ask([["explain", "true"]], { quiet: true, signal })).json();
      if (mine !== this.#run) return;
      fill(this.trouble);
      fill(this.proof);
      fill(this.graph, graph(plan));
      fill(this.decisions, decided(plan));
      const began = performance.now();
      const response = await this.#ask([], { signal });
      const picture = new Picture(await response.blob(), "result", { facts: factsOf(response) });
      const took = performance.now() - began;
      const result = await picture.look();
      if (mine !== this.#run) return;
      this.result = picture;
      this.stage.show({ result, floats: null, overlay: null });
      this.#map(mine);
      fill(this.account, account(response.headers, took));
      fill(this.graph, graph(plan, measured(response.headers.get("Server-Timing"))));
      const first = Object.values(this.#given)[0];
      this.stage.show({ input: first ? await first.look() : null });
    } catch (failure) {
      if (!signal.aborted) this.#fail(failure);
    } finally {
      if (mine === this.#run) this.stage.busy(false);
    }
  }

  // Runs the pipeline once as planned and once with nothing left out, and tells how far apart the two are, sample by sample.
  async #prove() {
    const mine = this.#run;
    fill(this.proof, "running both …");
    try {
      const [planned, whole] = await Promise.all(
        [false, true].map(async (all) => {
          const response = await this.#ask([["format", "npy"]], { headers: {}, quiet: true, all });
          return { headers: response.headers, ...read(await response.arrayBuffer()) };
        }),
      );
      const { most, overlay } = await apart(planned, whole);
      const sum = [planned, whole].reduce((before, each) => before + errorOf(each.headers).value, 0);
      fill(
        this.proof,
        `As planned and with everything run, the results differ by ${most ? short(most) : "nothing"}; each promises to be off by so little that they may differ by ${short(sum)}.${most ? " Over the picture: where, white where it is most, down to a millionth of that." : ""}`,
      );
      if (mine === this.#run) this.stage.show({ overlay: most ? overlay : null, opacity: 1 });
    } catch (failure) {
      fill(this.proof);
      this.#fail(failure);
    }
  }

  // Lays over the picture how many lights each tile looks at, and says why not the others.
  async #map(mine = this.#run) {
    fill(this.mapped);
    if (!this.kind.tiled || !this.tiles.checked) return this.stage.show({ overlay: null });
    try {
      const { overlay, words } = await tiles(
        await this.#ask([["explain", "map"]], { headers: { Accept: "multipart/mixed" }, quiet: true }),
      );
      if (mine !== this.#run || !this.tiles.checked) return undefined;
      fill(this.mapped, words);
      return this.stage.show({ overlay, opacity: 0.72 });
    } catch (failure) {
      if (mine === this.#run) fill(this.mapped, `No map: ${failure.errors?.[0]?.detail ?? failure.message}.`);
      return undefined;
    }
  }

  async #probe() {
    const { result } = this;
    if (!result || this.probing === result) return;
    this.probing = result;
    try {
      const response = await this.#ask([["format", "npy"]], { headers: {}, quiet: true });
      const floats = await new Picture(await response.blob(), "result", { facts: factsOf(response) }).floats();
      if (this.result === result) this.stage.show({ floats });
    } catch (failure) {
      this.#fail(failure);
    }
  }

  #fail(failure) {
    fill(this.trouble, problem(failure));
    this.stage.busy(false);
  }
}

// Milliseconds by node.
const measured = (header) =>
  new Map(
    stages(header)
      .filter(([name]) => name.startsWith("kernel."))
      .map(([name, time]) => [name.slice(7), time]),
  );

// Every decision in words, with what it can change at most and what it saves.
function decided(plan) {
  const chosen = plan.decisions.filter((each) => each.pass === "choose");
  const others = plan.decisions.filter((each) => each.pass !== "choose");
  return [
    h("details", { class: "more", open: true }, h("summary", "The plan in words"), noted(plan.notes)),
    others.length
      ? decisions("Left out and put together", others)
      : h("p", { class: "muted" }, "Nothing was left out or put together."),
    chosen.length
      ? h(
          "details",
          { class: "more" },
          h("summary", `How ${chosen.length} methods were chosen`),
          decisions("Methods chosen", chosen),
        )
      : null,
  ];
}

// Headings end in a colon, and what follows one begins with a dash.
function noted(lines) {
  const found = [];
  for (const line of lines) {
    if (line.startsWith("- ")) found.at(-1).append(h("li", line.slice(2)));
    else found.push(h("p", line.endsWith(":") ? h("b", line) : line), h("ul"));
  }
  return h("div", { class: "notes" }, found);
}

function decisions(label, all) {
  return h(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": label },
    h(
      "table",
      { class: "decisions" },
      h(
        "thead",
        h(
          "tr",
          ["pass", "node", "what", "why", "changes", "saves"].map((each) => h("th", { scope: "col" }, each)),
        ),
      ),
      h(
        "tbody",
        all.map((each) =>
          h(
            "tr",
            h("td", each.pass),
            h("td", h("code", each.node)),
            h("td", each.action),
            h("td", each.reason),
            h("td", each.bound ? short(each.bound) : "nothing"),
            h("td", each.saved_ms ? milliseconds(each.saved_ms) : "–"),
          ),
        ),
      ),
    ),
  );
}
