// What is asked of an operation: its parameters, how well and by which method, and the pictures it reads; as a request,
// and as the same request written for a shell or for Python.

import { asText, same } from "./schema.js";

export class Order {
  // `described` is the operation as the catalogue describes it.
  constructor(described, { values = {}, wishes = {}, inputs = {} } = {}) {
    Object.assign(this, { described, values, wishes, inputs });
  }

  get name() {
    return this.described.name;
  }

  get properties() {
    return this.described.parameters.properties ?? {};
  }

  value(name) {
    return this.values[name] !== undefined ? this.values[name] : this.properties[name]?.default;
  }

  // Pairs of the query: parameters that differ from their defaults, then wishes (method, knobs, max_error, ...).
  query(further = {}) {
    const required = new Set(this.described.parameters.required ?? []);
    const values = Object.entries(this.values).filter(
      ([name, value]) =>
        value !== undefined && value !== null && (required.has(name) || !same(value, this.properties[name]?.default)),
    );
    const wishes = Object.entries({ ...this.wishes, ...further }).filter(
      ([, value]) => value !== undefined && value !== null && value !== "",
    );
    return [...values, ...wishes].map(([name, value]) => [name, asText(value)]);
  }

  // The pictures as a body; a single one for the first input stands alone.
  body() {
    const given = Object.entries(this.inputs).filter(([, picture]) => picture);
    if (given.length === 0) return undefined;
    if (given.length === 1 && given[0][0] === this.described.inputs[0].name) return given[0][1].blob;
    const form = new FormData();
    for (const [name, picture] of given) form.append(name, picture.blob, fileName(name, picture));
    return form;
  }

  get path() {
    return `/v1/operations/${this.name}`;
  }

  // What is missing before it can run, in words; empty where nothing is.
  missing() {
    return this.described.inputs.filter((each) => each.required && !this.inputs[each.name]).map((each) => each.name);
  }

  copy(changes = {}) {
    return new Order(this.described, { values: this.values, wishes: this.wishes, inputs: this.inputs, ...changes });
  }
}

const ENDINGS = {
  "image/png": "png",
  "image/jpeg": "jpg",
  "image/webp": "webp",
  "image/tiff": "tif",
  "image/x-exr": "exr",
  "application/x-npy": "npy",
};

export const fileName = (name, picture) =>
  picture.file ?? `${picture.sample ?? name}.${ENDINGS[picture.blob.type] ?? "bin"}`;

const quoted = (text) => `'${text.replaceAll("'", "'\\''")}'`;

export function asCurl(order, origin, format) {
  const query = new URLSearchParams([...order.query(), ["format", format]]);
  const given = Object.entries(order.inputs).filter(([, picture]) => picture);
  const alone = given.length === 1 && given[0][0] === order.described.inputs[0].name;
  const files = given.map(([name, picture]) =>
    alone ? `--data-binary @${fileName(name, picture)}` : `-F ${quoted(`${name}=@${fileName(name, picture)}`)}`,
  );
  return [`curl ${quoted(`${origin}${order.path}?${query}`)}`, ...files, `-o result.${format}`].join(" \\\n  ");
}

const python = (value) =>
  JSON.stringify(value, (_, each) =>
    each === null ? "\0None" : each === true ? "\0True" : each === false ? "\0False" : each,
  ).replace(/"\\u0000(None|True|False)"/g, "$1");

export function asPython(order, origin) {
  const given = Object.entries(order.inputs).filter(([, picture]) => picture);
  const first = given[0]?.[0] === order.described.inputs[0]?.name ? given.shift() : undefined;
  const values = [...Object.entries(order.values), ...Object.entries(order.wishes)]
    .filter(([, value]) => value !== undefined && value !== null)
    .map(([name, value]) => `${name}=${python(value)}`);
  const said = [
    python(order.name),
    ...(first ? [python(fileName(...first))] : []),
    ...given.map((each) => `${each[0]}=Path(${python(fileName(...each))})`),
    ...values,
  ];
  return [
    ...(given.length ? ["from pathlib import Path", ""] : []),
    "from lichen_client import Client",
    "",
    `with Client(${python(origin)}) as client:`,
    `    result = client.run(${said.join(", ")})`,
    "print(result.array.shape, result.report.method, result.report.error)",
  ].join("\n");
}
