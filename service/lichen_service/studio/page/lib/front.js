// Which settings are worth their time: the front of error against time, and what one more digit costs along it.

import { milliseconds, more, short } from "./numbers.js";

// Settings of a node of a plan: { id, method, knob, error, typical, kind, ms, verdict, unfit, chosen }. `used` is the
// setting that ran, where another one was named than the plan would have taken.
export function settings(node, used = node) {
  const close = (a, b) => (a ?? 0) === (b ?? 0) || Math.abs(a / b - 1) < 1e-4; // headers hold six digits
  return (node?.alternatives ?? []).map((each) => ({
    id: `${each.method}/${each.knob ?? ""}`,
    method: each.method,
    knob: each.knob,
    typical: each.typical,
    ms: each.milliseconds,
    stated: each.result_error?.value,
    kind: each.result_error?.kind, // of the whole result, conversions before and after included
    verdict: each.verdict,
    unfit: each.verdict.startsWith("not possible"),
    chosen: each.method === used.method && close(each.knob, used.knob),
  }));
}

// By which error they differ: the one that is stated, unless all state the same and the typical one tells them apart.
export function ranking(all) {
  const fit = all.filter((each) => !each.unfit && Number.isFinite(each.stated));
  const spread = (values) => (values.length > 1 ? Math.max(...values) / Math.max(Math.min(...values), 1e-30) : 1);
  const stated = fit.map((each) => each.stated);
  const typical = fit.map((each) => each.typical).filter(Number.isFinite);
  return spread(stated) < 4 && typical.length === fit.length && spread(typical) > 1.5 ? "typical" : "stated";
}

// The settings with `error` by that ranking, and whether nothing is both faster and as accurate.
export function judged(all) {
  const by = ranking(all);
  const fit = all
    .filter((each) => !each.unfit && Number.isFinite(each[by]) && each[by] !== null && each.ms > 0)
    .map((each) => ({ ...each, error: each[by] }));
  let best = Infinity;
  for (const each of [...fit].sort((a, b) => a.ms - b.ms || a.error - b.error)) {
    each.front = each.error < best;
    if (each.front) best = each.error;
  }
  return { by, points: fit };
}

export const front = (points) => points.filter((each) => each.front).sort((a, b) => a.ms - b.ms);

export const named = ({ method, knob }) =>
  knob === null || knob === undefined ? method : `${method} at ${setting(knob)}`;

// A knob's value as its author wrote it: 1e-4, 0.25, 4096.
export const setting = (knob) => (Math.abs(knob) >= 0.1 ? String(Number(knob.toPrecision(6))) : short(knob));

// What a tenfold smaller error would cost from the setting in use, in a sentence; with the setting that gives it.
export function tenfold(points, inUse) {
  if (!inUse) return null;
  if (inUse.error === 0) return { text: "This is exact: there is no error left to pay for." };
  const along = front(points);
  const better = along.find((each) => each.error <= inUse.error / 10);
  if (better) {
    const times = `${milliseconds(better.ms)} instead of ${milliseconds(inUse.ms)}`;
    return {
      text: [
        `A tenfold smaller error, ${short(better.error)} instead of ${short(inUse.error)}, costs`,
        `${more(better.ms / inUse.ms)}: ${times}, by ${named(better)}.`,
      ].join(" "),
      point: better,
    };
  }
  const best = along.at(-1);
  const beyond = "Below that only the definition itself is left, in doubles, however long that takes.";
  if (!best || best.error >= inUse.error * 0.99)
    return { text: `Nothing has a tenfold smaller error: no setting is more accurate than the one in use. ${beyond}` };
  const [gain, cost] = [inUse.error / best.error, best.ms / inUse.ms];
  const rate = cost > 1.05 && gain > 1.5 ? cost ** (Math.LN10 / Math.log(gain)) : 0;
  const going = rate ? `; at that rate a tenfold smaller one would cost about ${short(rate, 2)} times the time` : "";
  return {
    text: [
      `No setting has a tenfold smaller error. The smallest is ${short(gain, 2)} times smaller, for ${more(cost)}`,
      `(${milliseconds(best.ms)} instead of ${milliseconds(inUse.ms)}, by ${named(best)})${going}. ${beyond}`,
    ].join(" "),
    point: best,
  };
}

const STEP = 1 / 255;

// What an error means to the eye, for results that are pictures.
export function meaning(error) {
  const scale = `Errors count from black, 0, to white, 1: one step of an 8-bit picture is ${short(STEP)}`;
  if (!(error > 0)) return `${scale}.`;
  const steps = error / STEP;
  if (steps < 0.5) return `${scale}, so that what is in use, ${short(error)}, cannot be seen.`;
  return `${scale}; what is in use may be off by ${short(error)}, ${short(steps, 2)} ${steps > 0.95 && steps < 1.05 ? "step" : "steps"}.`;
}
