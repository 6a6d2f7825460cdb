// Pipelines: operations in a row, or a graph of them, as text.

import { showcase } from "../lib/samples.js";
import { Planned } from "../parts/planned.js";

const KIND = {
  name: "pipelines",
  path: "/v1/pipelines",
  title: "Pipelines",
  label: "Pipeline",
  lead: "Operations in a row, or a graph of them, planned as a whole: what changes nothing is dropped, what can run together does.",
  hint: "operation:name=value,…|operation … Ctrl+Enter runs it.",
  rows: 4,
  text: (preset) => preset.pipeline,
  sent(text, given) {
    const pictures = Object.entries(given);
    const body = pictures.length ? new FormData() : undefined;
    for (const [name, picture] of pictures) body.append(name, picture.blob, `${name}.bin`);
    return { query: [["pipeline", text]], body };
  },
};

export const mount = async (root) => new Planned(root, (await showcase()).pipelines, KIND);
