// A picture of the page: encoded bytes, their name, and on demand how they look and what floats they hold.

import { request } from "./api.js";
import { read } from "./npy.js";
import { shown } from "./shown.js";

const SEEN = new Set(["image/png", "image/jpeg", "image/webp"]); // what a browser decodes as we do

export const BITMAP = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

export class Picture {
  #floats;
  #look;

  // `facts` are { space, alpha } where they are known, as of a result.
  constructor(blob, title, { facts, sample } = {}) {
    Object.assign(this, { blob, title, facts, sample });
  }

  // { data, width, height, channels, pages, space, alpha }: the service decodes what is no NPY yet.
  floats() {
    this.#floats ??= this.#read().catch((failure) => {
      this.#floats = undefined;
      throw failure;
    });
    return this.#floats;
  }

  // { bitmaps, width, height, range }: a bitmap of this size for each page
  look() {
    this.#look ??= this.#seen().catch((failure) => {
      this.#look = undefined;
      throw failure;
    });
    return this.#look;
  }

  async #read() {
    if (this.blob.type === "application/x-npy" && this.facts)
      return { ...read(await this.blob.arrayBuffer()), ...this.facts };
    const response = await request("POST", "/v1/operations/arrange", {
      query: [["format", "npy"]],
      body: this.blob,
      quiet: true,
    });
    const facts = factsOf(response);
    this.facts ??= facts;
    return { ...read(await response.arrayBuffer()), ...facts };
  }

  async #seen() {
    if (SEEN.has(this.blob.type)) {
      const bitmap = await createImageBitmap(this.blob, BITMAP);
      return { bitmaps: [bitmap], width: bitmap.width, height: bitmap.height, range: null };
    }
    const floats = await this.floats();
    const { pictures, range } = shown(floats, floats);
    const bitmaps = await Promise.all(pictures.map((each) => createImageBitmap(each, BITMAP)));
    return { bitmaps, width: floats.width, height: floats.height, range };
  }
}

// What the numbers of an answer mean, from `Lichen-Space: srgb; alpha=straight; storage=uint8`.
export function factsOf(response) {
  const [space = "data", ...rest] = (response.headers.get("Lichen-Space") ?? "").split(";").map((each) => each.trim());
  const alpha = rest.find((each) => each.startsWith("alpha="))?.slice(6) ?? "none";
  return { space: space || "data", alpha };
}
