// One control for each kind of parameter. Each is { element, set(value), focus() }, and says `changed(value, dragging)`.

import { fill, h, unique } from "../lib/dom.js";
import { short } from "../lib/numbers.js";
import { curve } from "./curve.js";

export function controlFor(kind, about) {
  const made = (KINDS[kind.kind] ?? json)(kind, about);
  return kind.optional ? optional(made, about) : made;
}

const KINDS = { number, switch: toggle, choice, vector, matrix, text, curve };

// A slider and a field. The slider covers what is usual; the field takes all that is allowed.
function number(kind, { label, id, value, changed }) {
  const scale = scaleOf(kind, value);
  const field = h("input", {
    id,
    class: "number",
    type: "number",
    step: kind.integer ? 1 : "any",
    inputmode: "decimal",
  });
  if (Number.isFinite(kind.low) && !kind.open) field.min = kind.low;
  if (Number.isFinite(kind.high)) field.max = kind.high;
  const slider = h("input", {
    type: "range",
    class: "slider",
    min: 0,
    max: 1000,
    step: 1,
    "aria-label": `${label}, slider`,
  });
  const show = (now) => {
    const place = scale.place(now ?? scale.low) * 1000;
    slider.value = place;
    slider.style.setProperty("--filled", `${Math.min(100, Math.max(0, place / 10))}%`);
    slider.setAttribute("aria-valuetext", `${short(now ?? scale.low)}${kind.unit ? ` ${kind.unit}` : ""}`);
  };
  const read = (dragging) => {
    const now = scale.value(Number(slider.value) / 1000);
    field.value = now;
    show(now);
    changed(now, dragging);
  };
  slider.addEventListener("input", () => read(true));
  slider.addEventListener("change", () => read(false));
  field.addEventListener("change", () => {
    if (field.value === "") return;
    show(Number(field.value));
    changed(Number(field.value), false);
  });
  const set = (now) => {
    field.value = now ?? "";
    show(now);
  };
  set(value);
  return {
    element: h("div", { class: "row-number" }, slider, field, h("span", { class: "unit" }, kind.unit ?? "")),
    set,
  };
}

// Where a value lies on the slider, 0 to 1, and back. Ranges too wide for a hand end where values become unusual, and give
// small values more room.
function scaleOf({ low, high, integer, open }, value = 0) {
  const bottom = Number.isFinite(low) && low > -1e4 ? low : -Math.max(4 * Math.abs(value), 2);
  const wide = high - low > 2000 || !Number.isFinite(high - low);
  const top = wide ? Math.min(high, Math.max(6 * Math.abs(value), bottom + (integer ? 16 : 4), 1)) : high;
  const power = wide && bottom >= 0 ? 2 : 1;
  const digits = integer ? 0 : Math.max(0, 3 - Math.floor(Math.log10(top - bottom)));
  return {
    low: bottom,
    place: (now) => Math.min(1, Math.max(0, (now - bottom) / (top - bottom))) ** (1 / power),
    value: (place) => {
      const now = Number((bottom + (top - bottom) * place ** power).toFixed(digits));
      return open && now <= low ? Number((low + (top - bottom) / 1000).toPrecision(2)) : now;
    },
  };
}

function toggle(kind, { id, value, changed }) {
  const box = h("input", {
    id,
    type: "checkbox",
    class: "switch",
    role: "switch",
    onchange: () => changed(box.checked, false),
  });
  const set = (now) => {
    box.checked = Boolean(now);
  };
  set(value);
  return { element: box, set };
}

function choice(kind, { id, label, value, changed }) {
  return kind.choices.length <= 3 && kind.choices.join("").length < 24
    ? segments(kind, { label, value, changed })
    : menu(kind, { id, value, changed });
}

function menu(kind, { id, value, changed }) {
  const field = h(
    "select",
    { id, onchange: () => changed(kind.choices[field.selectedIndex], false) },
    kind.choices.map((each) => h("option", String(each))),
  );
  const set = (now) => {
    field.selectedIndex = kind.choices.indexOf(now);
  };
  set(value);
  return { element: field, set };
}

// A few choices beside one another.
export function segments({ choices, titles = {} }, { label, value, changed }) {
  const name = unique("choice");
  const boxes = choices.map((each) =>
    h("input", { type: "radio", name, value: each, onchange: () => changed(each, false) }),
  );
  const element = h(
    "div",
    { class: "segments", role: "radiogroup", "aria-label": label },
    choices.map((each, i) => h("label", boxes[i], h("span", titles[each] ?? String(each)))),
  );
  const set = (now) =>
    boxes.forEach((box, i) => {
      box.checked = choices[i] === now;
    });
  set(value);
  return { element, set, group: true };
}

function vector(kind, about) {
  return grid(
    [1, kind.length],
    about,
    (rows) => rows[0],
    (value) => [value ?? Array(kind.length).fill(0)],
  );
}

function matrix(kind, about) {
  const rows = about.value.length;
  return grid(
    [rows, about.value[0].length],
    about,
    (all) => all,
    (value) => value,
  );
}

function grid([rows, columns], { label, value, changed }, out, into) {
  const cells = Array.from({ length: rows }, (_, row) =>
    Array.from({ length: columns }, (_, column) =>
      h("input", {
        type: "number",
        step: "any",
        class: "cell",
        inputmode: "decimal",
        "aria-label": rows === 1 ? `${label}, number ${column + 1}` : `${label}, row ${row + 1}, column ${column + 1}`,
        onchange: () => changed(out(cells.map((line) => line.map((cell) => Number(cell.value)))), false),
      }),
    ),
  );
  const element = h("div", { class: "grid-cells", role: "group", "aria-label": label }, cells);
  element.style.setProperty("--columns", columns);
  const set = (now) =>
    into(now).forEach((line, row) =>
      line.forEach((each, column) => {
        if (cells[row]?.[column]) cells[row][column].value = each;
      }),
    );
  set(value);
  return { element, set, group: true };
}

function text(kind, { id, value, changed }) {
  const field = h(kind.long ? "textarea" : "input", {
    id,
    rows: kind.long ? 3 : undefined,
    spellcheck: "false",
    class: "wide",
  });
  field.addEventListener("change", () => changed(field.value, false));
  const set = (now) => {
    field.value = now ?? "";
  };
  set(value);
  return { element: field, set };
}

// Whatever has no control of its own, as the JSON that it is.
function json(kind, { id, value, changed }) {
  const field = h("textarea", { id, rows: 3, spellcheck: "false", class: "wide code" });
  field.addEventListener("change", () => {
    try {
      const now = field.value.trim() === "" ? undefined : JSON.parse(field.value);
      field.setCustomValidity("");
      changed(now, false);
    } catch {
      field.setCustomValidity("This is not JSON.");
      field.reportValidity();
    }
  });
  const set = (now) => {
    field.value = now === undefined || now === null ? "" : JSON.stringify(now);
  };
  set(value);
  return { element: field, set };
}

// A parameter that may be left out: a box says whether it is there.
function optional(inner, about) {
  const box = h("input", { type: "checkbox", "aria-label": `give ${about.label}` });
  const slot = h("div", { class: "optional-slot" });
  for (const field of [inner.element, ...inner.element.querySelectorAll("input, select, textarea")]) {
    if (field.matches("input, select, textarea") && !field.hasAttribute("aria-label"))
      field.setAttribute("aria-label", about.label);
  }
  const element = h("div", { class: "optional" }, box, slot);
  const show = (there) => {
    box.checked = there;
    fill(slot, there ? inner.element : h("span", { class: "muted" }, "automatic"));
  };
  box.addEventListener("change", () => {
    show(box.checked);
    if (!box.checked) about.changed(undefined, false);
    else if (about.suggested !== undefined) {
      inner.set(about.suggested);
      about.changed(about.suggested, false);
    }
  });
  const set = (now) => {
    const there = now !== undefined && now !== null;
    show(there);
    if (there) inner.set(now);
  };
  set(about.value);
  return { element, set, group: true };
}
