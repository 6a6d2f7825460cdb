// From a parameter's JSON Schema to the control that suits it, and its value from and to text.

// { kind, optional, ...}: number (integer, low, high), switch, choice (choices), vector (length), matrix, curve, text, json
export function control(schema, value) {
  const offered = schema.anyOf ?? [schema];
  const kinds = offered.filter((each) => each.type !== "null");
  const optional = kinds.length < offered.length;
  const current = value ?? schema.default;
  const fitting = kinds.find((each) => fits(each, current)) ?? kinds[0];
  return { optional, unit: schema.unit ?? fitting.unit, ...kindOf({ ...fitting }, current) };
}

function fits(schema, value) {
  if (Array.isArray(value)) return schema.type === "array";
  if (typeof value === "number") return schema.type === "number" || schema.type === "integer";
  if (typeof value === "boolean") return schema.type === "boolean";
  return typeof value === "string" && schema.type === "string";
}

function kindOf(schema, value) {
  if (schema.type === "boolean") return { kind: "switch" };
  if (schema.enum) return { kind: "choice", choices: schema.enum };
  if (schema.const !== undefined) return { kind: "choice", choices: [schema.const] };
  if (schema.type === "number" || schema.type === "integer") return { kind: "number", ...range(schema) };
  if (schema.type === "string") return { kind: "text", long: (schema.maxLength ?? 0) > 200 };
  if (schema.type === "array") return many(schema, value);
  return { kind: "json" };
}

function range(schema) {
  const over = schema.exclusiveMinimum;
  return {
    integer: schema.type === "integer",
    low: schema.minimum ?? over ?? -Infinity,
    high: schema.maximum ?? schema.exclusiveMaximum ?? Infinity,
    open: over !== undefined,
  };
}

function many(schema, value) {
  const flat = (list) => Array.isArray(list) && list.every((each) => typeof each === "number");
  const fixed =
    schema.prefixItems?.length ?? (schema.minItems && schema.minItems === schema.maxItems ? schema.minItems : 0);
  const first = schema.prefixItems?.[0] ?? schema.items;
  const scalar = first && (first.type === "number" || first.type === "integer");
  if (flat(value) && value.length <= 8 && value.length > 0) return { kind: "vector", length: value.length };
  if (scalar && fixed) return { kind: "vector", length: fixed };
  if (Array.isArray(value) && value.length > 0 && value.every(flat)) {
    const [rows, columns] = [value.length, value[0].length];
    const even = value.every((row) => row.length === columns);
    if (even && columns === 2 && ascending(value)) return { kind: "curve" };
    if (even && rows <= 9 && columns <= 9) return { kind: "matrix" };
  }
  return { kind: "json" };
}

const ascending = (points) =>
  points.length >= 2 &&
  points.every(([x], i) => i === 0 || x > points[i - 1][0]) &&
  points.every((each) => each.every((c) => c >= 0 && c <= 1));

// A value as the query of a URL has it: text plain, everything else as JSON.
export const asText = (value) => (typeof value === "string" ? value : JSON.stringify(value));

// A value from such text, by the schema that it is for.
export function fromText(schema, text) {
  const texts = (schema?.anyOf ?? [schema ?? {}]).some((each) => each.type === "string");
  try {
    const value = JSON.parse(text);
    return texts && typeof value !== "object" ? text : value;
  } catch {
    return text;
  }
}

export const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
