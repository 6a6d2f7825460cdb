// Elements in one line: h("button", { class: "plain", onclick: act }, "Run"). Text is always text, never markup.

const SVG = "http://www.w3.org/2000/svg";

export const h = (tag, ...rest) => made(document.createElement(tag), rest);
export const s = (tag, ...rest) => made(document.createElementNS(SVG, tag), rest);

function made(element, [first, ...rest]) {
  const plain = first !== null && typeof first === "object" && !(first instanceof Node) && !Array.isArray(first);
  if (plain) set(element, first);
  add(element, plain ? rest : [first, ...rest]);
  return element;
}

export function set(element, properties) {
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) element.removeAttribute(name);
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value" && "value" in element) element.value = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  return element;
}

export function add(element, children) {
  for (const child of children.flat(Infinity)) {
    if (child !== undefined && child !== null && child !== false) element.append(child);
  }
  return element;
}

export function fill(element, ...children) {
  element.replaceChildren();
  return add(element, children);
}

// An identifier that no other element of the page has, for labels.
let count = 0;
export const unique = (stem) => `${stem}-${(count += 1)}`;

// A mark from the page's own set, drawn with strokes; says nothing to a screen reader.
export function icon(name) {
  return s(
    "svg",
    { class: "icon", "aria-hidden": "true", viewBox: "0 0 24 24" },
    ICONS[name].map((d) => s("path", { d })),
  );
}

const ICONS = {
  search: ["M11 4a7 7 0 1 0 0 14a7 7 0 0 0 0-14z", "M16 16l5 5"],
  close: ["M6 6l12 12", "M18 6L6 18"],
  copy: ["M9 9h11v11H9z", "M5 15H4V4h11v1"],
  download: ["M12 4v11", "M7 11l5 5l5-5", "M5 20h14"],
  plus: ["M12 5v14", "M5 12h14"],
  minus: ["M5 12h14"],
  fit: ["M4 9V4h5", "M20 9V4h-5", "M4 15v5h5", "M20 15v5h-5"],
  reset: ["M4 4v6h6", "M5 14a8 8 0 1 0 2-8l-3 4"],
  menu: ["M4 6h16", "M4 12h16", "M4 18h16"],
  sun: [
    "M12 8a4 4 0 1 0 0 8a4 4 0 0 0 0-8z",
    "M12 2v2",
    "M12 20v2",
    "M2 12h2",
    "M20 12h2",
    "M5 5l1.5 1.5",
    "M17.5 17.5L19 19",
    "M5 19l1.5-1.5",
    "M17.5 6.5L19 5",
  ],
  upload: ["M12 16V5", "M7 9l5-5l5 5", "M5 20h14"],
  check: ["M5 13l4 4L19 7"],
  play: ["M8 5l11 7l-11 7z"],
  pause: ["M9 5v14", "M15 5v14"],
  cross: ["M6 6l12 12", "M18 6L6 18"],
};
