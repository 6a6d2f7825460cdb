// What lies over a picture that was planned: how many lights each tile looks at, or where running everything gives another
// picture.

import { short } from "../lib/numbers.js";
import { parts } from "../lib/multipart.js";
import { BITMAP } from "../lib/picture.js";

const DECADES = 6; // below the largest difference

// { overlay, words } of an answer to explain=map: its picture, and what its tiles leave out.
export async function tiles(response) {
  const [picture, told] = parts(response.headers.get("Content-Type"), await response.arrayBuffer());
  const map = JSON.parse(new TextDecoder().decode(told.body));
  const overlay = await createImageBitmap(new Blob([picture.body], { type: "image/png" }), BITMAP);
  const count = map.effects.length;
  const shares = map.shares.flat();
  const lit = shares.reduce((sum, each) => sum + each, 0) / shares.length;
  const skipped = map.decisions.filter((each) => each.pass === "tiles").map((each) => each.reason);
  const begin = `Of ${count} ${count === 1 ? "light" : "lights"}, a tile of ${map.tile} px looks at ${short(lit * count)} on the mean; bright tiles look at all, black ones at none.`;
  return { overlay, words: [begin, ...skipped.map((each) => `${each[0].toUpperCase()}${each.slice(1)}.`)].join(" ") };
}

// { overlay, most } of two results of one size: black where they are the same, white where they are farthest apart.
export async function apart(a, b) {
  const { width, height, channels } = a;
  const found = new Float32Array(width * height);
  let most = 0;
  for (let i = 0; i < a.data.length; i += 1) {
    if (Object.is(a.data[i], b.data[i])) continue;
    const off = Math.abs(a.data[i] - b.data[i]);
    const far = Number.isNaN(off) ? Infinity : off; // only one of them is finite
    const at = Math.floor(i / channels);
    found[at] = Math.max(found[at], far);
    most = Math.max(most, far);
  }
  const picture = new ImageData(width, height);
  for (let at = 0; at < found.length; at += 1) {
    const level = found[at] === most ? 1 : 1 + Math.log10(found[at] / most) / DECADES;
    const grey = most && found[at] ? 40 + 215 * Math.max(0, Math.min(1, level)) : 0;
    picture.data.set([grey, grey, grey, 255], 4 * at);
  }
  return { most, overlay: await createImageBitmap(picture, BITMAP) };
}
