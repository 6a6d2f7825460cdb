// What the page brings along: samples, and what each operation is first shown with. Pictures are made by the service when
// they are first wanted.

import { json, request } from "./api.js";
import { factsOf, Picture } from "./picture.js";

let told;
const made = new Map();

export function showcase() {
  told ??= json("/studio/showcase.json", { quiet: true }).catch((failure) => {
    told = undefined;
    throw failure;
  });
  return told;
}

// The picture of a sample by its name.
export function sample(name) {
  if (!made.has(name))
    made.set(
      name,
      make(name).catch((failure) => {
        made.delete(name);
        throw failure;
      }),
    );
  return made.get(name);
}

// Noise of a kind that the showcase names, with a seed of its own each time; not kept.
export async function noise(kind) {
  const { title, pipeline } = (await showcase()).noise[kind];
  const seed = Math.floor(Math.random() * 2 ** 31);
  return drawn({ title: `${title}, seed ${seed}`, pipeline: pipeline.replaceAll("SEED", seed) }, `${kind}-${seed}`);
}

async function make(name) {
  const each = (await showcase()).samples.find((one) => one.name === name);
  if (!each) throw new Error(`There is no sample ${name}.`);
  return drawn(each, name);
}

async function drawn(each, name) {
  if (each.file) {
    const response = await request("GET", `/studio/content/${each.file}`, { quiet: true });
    return new Picture(await response.blob(), each.title, { sample: name, facts: { space: "srgb", alpha: "none" } });
  }
  const body = new FormData();
  for (const [input, other] of Object.entries(each.inputs ?? {})) {
    body.append(input, (await sample(other)).blob, `${other}.bin`);
  }
  const empty = Object.keys(each.inputs ?? {}).length === 0;
  const ask = (format, further = []) =>
    request("POST", "/v1/pipelines", {
      query: [
        ["pipeline", each.pipeline],
        ["format", format],
        ...(each.space ? [["space", each.space]] : []),
        ...further,
      ],
      body: empty ? undefined : body,
      quiet: true,
    });
  // Pictures travel on in a format that says what their numbers mean; data as the floats it is.
  const response = await ask("npy");
  const facts = factsOf(response);
  if (facts.space === "data") {
    return new Picture(new Blob([await response.arrayBuffer()], { type: "application/x-npy" }), each.title, {
      sample: name,
      facts,
    });
  }
  const encoded =
    facts.space === "linear"
      ? await ask("exr")
      : await ask("png", facts.alpha === "none" ? [] : [["alpha", "straight"]]);
  return new Picture(await encoded.blob(), each.title, { sample: name });
}
