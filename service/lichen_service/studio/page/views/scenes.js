// Scenes: objects, lights, fog and lens as JSON, with a dial for every number of lens, fog and lights. The plan tells which effects
// run, and why the others do not.

import { showcase } from "../lib/samples.js";
import { dials } from "../parts/dials.js";
import { Planned } from "../parts/planned.js";

const KIND = {
  name: "scenes",
  path: "/v1/scenes",
  title: "Scenes",
  label: "Scene",
  lead: "Objects, lights, fog and a lens. Only what the picture calls for is computed: turn a light or the fog down to nothing, or close the aperture, and see its effect leave the plan.",
  hint: "Lengths are of any one unit, angles in degrees, colours linear light. Ctrl+Enter runs it.",
  rows: 14,
  text: (preset) => laid(preset.scene),
  sent: (text) => ({ query: [], body: text, headers: { "Content-Type": "application/json" } }),
  tiled: true,
  dials: (text, turned) => dials(text, (scene) => turned(laid(scene))),
};

export const mount = async (root) => new Planned(root, (await showcase()).scenes, KIND);

// JSON with short lists on one line.
function laid(scene) {
  return JSON.stringify(scene, null, 1).replace(/\[[^[\]{}]*\]/g, (list) => list.replace(/\s+/g, " "));
}
