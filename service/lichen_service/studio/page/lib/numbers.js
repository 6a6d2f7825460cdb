// Numbers as people read them. Three significant digits unless asked; exponents only where zeros would have to be counted.

export function short(value, digits = 3) {
  if (value === null || value === undefined) return "–";
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 0.001 && size < 1e5) return String(Number(value.toPrecision(digits)));
  return value
    .toExponential(digits - 1)
    .replace(/\.?0+e/, "e")
    .replace("e+", "e");
}

export const milliseconds = (value) => (value >= 1000 ? `${short(value / 1000)} s` : `${short(value)} ms`);

export function bytes(count) {
  const steps = ["B", "kB", "MB", "GB", "TB"];
  let power = 0;
  for (let rest = count; rest >= 1000 && power < steps.length - 1; rest /= 1000) power += 1;
  return `${short(count / 1000 ** power)} ${steps[power]}`;
}

// How much more one time is than another: "12 % more time", "3.1 times the time".
export function more(ratio) {
  if (ratio < 1.005 && ratio > 0.995) return "the same time";
  if (ratio < 1) return `${short((1 - ratio) * 100, 2)} % less time`;
  return ratio < 1.95 ? `${short((ratio - 1) * 100, 2)} % more time` : `${short(ratio, 2)} times the time`;
}

// A sample of an image, in as many digits as a float32 of its size can show.
export const sample = (value) =>
  Number.isFinite(value)
    ? Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-4)
      ? value.toExponential(4)
      : value.toFixed(5)
    : short(value);

// Powers of ten, and where they are few also 2 and 5 times them, from `low` to `high`: where a logarithmic axis has marks.
export function decades(low, high) {
  const first = Math.floor(Math.log10(low));
  const last = Math.ceil(Math.log10(high));
  const factors = last - first <= 2 ? [1, 2, 5] : [1];
  const found = [];
  for (let power = first; power <= last; power += 1) for (const each of factors) found.push(each * 10 ** power);
  const inside = found.filter((each) => each >= low * 0.999 && each <= high * 1.001);
  const every = Math.ceil(inside.length / 6);
  return inside.filter((_, index) => index % every === 0);
}
