// The form of an operation, built from the JSON Schema of its parameters.

import { h, unique } from "../lib/dom.js";
import { control, same } from "../lib/schema.js";
import { controlFor } from "./controls.js";

const SHOWN = 4; // more parameters wait behind one line

// `changed(name, value, dragging)` hears of every change. Returns { element, blame(errors) }.
// `first` are the parameters that are to be seen at once, `sequence` all of them.
export function form(order, { first = [], sequence = [], changed }) {
  const rows = new Map();
  const names = [...new Set([...sequence, ...Object.keys(order.properties)])].filter(
    (name) => name in order.properties,
  );
  const late = (name) =>
    first.includes(name) ? 0 : order.properties[name].anyOf?.some((each) => each.type === "null") ? 2 : 1;
  names.sort((a, b) => late(a) - late(b)); // what may be left out comes last
  // Some controls show what others say: `beside` hears of every value.
  const values = new Map(names.map((name) => [name, order.value(name)]));
  const told = () => {
    for (const each of rows.values()) each.beside?.((name) => values.get(name));
  };
  const heard = (name, value, dragging) => {
    values.set(name, value ?? order.properties[name].default);
    told();
    changed(name, value, dragging);
  };
  for (const name of names) rows.set(name, row(name, order.properties[name], order, heard));
  told();
  const all = [...rows.values()].map((each) => each.element);
  const count = Math.max(SHOWN, first.length);
  const rest = all.length > count + 1 ? all.slice(count) : [];
  const more = rest.length
    ? h("details", { class: "more" }, h("summary", `${rest.length} more parameters`), rest)
    : null;
  const element = h("div", { class: "form" }, rest.length ? all.slice(0, count) : all, more);
  if (all.length === 0) element.append(h("p", { class: "muted" }, "This operation has no parameters."));

  // Marks the fields that the service found fault with, and returns the errors that belong to none.
  const blame = (errors) => {
    for (const each of rows.values()) each.blame("");
    return errors.filter(({ pointer, detail }) => {
      const name = /^\/parameters\/([^/]+)/.exec(pointer)?.[1];
      const blamed = rows.get(name);
      blamed?.blame(detail);
      if (blamed && rest.includes(blamed.element)) more.open = true;
      return !blamed;
    });
  };
  return { element, blame };
}

function row(name, schema, order, changed) {
  const id = unique(name);
  const value = order.value(name) ?? undefined;
  const kind = control(schema, value);
  const label = name.replaceAll("_", " ");
  const made = controlFor(kind, {
    id,
    label,
    value,
    suggested: suggestion(kind),
    changed: (now, dragging) => {
      reset.hidden = same(now, schema.default) || now === undefined;
      changed(name, now, dragging);
    },
  });
  const reset = h(
    "button",
    {
      class: "reset",
      type: "button",
      title: "back to the default",
      "aria-label": `${label}: back to the default`,
      hidden: value === undefined || same(value, schema.default) || schema.default === undefined,
      onclick: () => {
        made.set(schema.default);
        changed(name, undefined, false);
        reset.hidden = true;
      },
    },
    "default",
  );
  const note = h("p", { class: "blame", id: `${id}-wrong`, role: "alert", hidden: true });
  const about = schema.description ? h("p", { class: "about", id: `${id}-about` }, schema.description) : null;
  const title = made.group ? h("span", { class: "name" }, label) : h("label", { class: "name", for: id }, label);
  const element = h(
    "div",
    { class: `field kind-${kind.optional ? "optional" : kind.kind}`, "data-parameter": name },
    h("div", { class: "field-head" }, title, reset),
    made.element,
    about,
    note,
  );
  const inner = element.querySelector(`#${id}`);
  if (about && inner) inner.setAttribute("aria-describedby", about.id);
  const blame = (detail) => {
    note.textContent = detail ? `${label}: ${detail}` : "";
    note.hidden = !detail;
    element.classList.toggle("wrong", Boolean(detail));
    inner?.setAttribute("aria-invalid", detail ? "true" : "false");
  };
  return { element, blame, beside: made.beside };
}

// What a parameter is first set to that was left to the service.
function suggestion(kind) {
  if (kind.kind === "number")
    return Number.isFinite(kind.low) ? Math.max(kind.low + (kind.open ? 1 : 0), Math.min(kind.high, 1)) : 0;
  if (kind.kind === "choice") return kind.choices[0];
  return kind.kind === "vector" ? Array(kind.length).fill(0) : undefined;
}
