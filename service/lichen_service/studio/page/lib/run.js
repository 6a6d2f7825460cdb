// One run of an order: the picture that came back as it is looked at, and the account that came with it.

import { request } from "./api.js";
import { parts } from "./multipart.js";
import { BITMAP, factsOf, Picture } from "./picture.js";

const CUT = 1e-3; // share of samples beyond what a PNG holds from which the floats are looked at instead
// A PNG where it holds the result. Two channels, more than four, and several pages it does not: those come as floats.
export const SEEN = "image/png, application/x-npy;q=0.5";

export async function run(order, { signal, preview = null, verify = false } = {}) {
  const { described } = order;
  const several = (verify || described.findings) && !preview;
  const query = preview ? order.copy({ wishes: preview }).query() : order.query(verify ? { verify: true } : {});
  const began = performance.now();
  const response = await request("POST", order.path, {
    query,
    signal,
    body: order.body(),
    headers: { Accept: several ? `multipart/mixed, ${SEEN}` : SEEN },
  });
  const buffer = await response.arrayBuffer();
  const took = performance.now() - began;
  const type = response.headers.get("Content-Type");
  const all = type.startsWith("multipart/")
    ? parts(type, buffer)
    : [{ headers: new Map([["content-type", type]]), body: buffer }];
  const typed = (wanted) => all.slice(1).find((each) => each.headers.get("content-type").startsWith(wanted));
  const map = all.find((each) => each.headers.has("lichen-map"));
  const found = typed("application/json");
  const facts = factsOf(response);
  const picture = new Picture(new Blob([all[0].body], { type: all[0].headers.get("content-type") }), "result", {
    facts,
  });
  return {
    picture,
    facts,
    took,
    headers: response.headers,
    preview: Boolean(preview),
    look: await looked(order, picture, response.headers, facts, { signal, preview }),
    findings: found ? JSON.parse(new TextDecoder().decode(found.body)) : null,
    map: map && picture.blob.type === "image/png" ? await bitmapOf(map.body) : null,
    scale: scaleOf(map?.headers.get("lichen-map")),
  };
}

const bitmapOf = (body) => createImageBitmap(new Blob([body], { type: "image/png" }), BITMAP);

// Data that a PNG cut off is fetched once more, as floats, and stretched.
async function looked(order, picture, headers, facts, { signal, preview }) {
  const look = await picture.look();
  const cut = Number(headers.get("Lichen-Clipped") ?? 0) / (look.width * look.height * 3);
  if (picture.blob.type !== "image/png" || facts.space !== "data" || cut < CUT) return look;
  return (await asFloats(order, { signal, preview })).look();
}

// The result as the floats it is.
export async function asFloats(order, { signal, preview } = {}) {
  const asked = preview ? order.copy({ wishes: preview }) : order;
  const response = await request("POST", order.path, {
    query: [...asked.query(), ["format", "npy"]],
    signal,
    body: order.body(),
    quiet: true,
  });
  return new Picture(await response.blob(), "result", { facts: factsOf(response) });
}

// The plan, as it would be if no method were named: it judges all of them.
export async function explain(order) {
  const named = new Set(["method", ...order.described.methods.map((each) => each.knob?.name)]);
  const wishes = Object.fromEntries(Object.entries(order.wishes).filter(([name]) => !named.has(name)));
  const response = await request("POST", order.path, {
    query: order.copy({ wishes }).query({ explain: true }),
    body: order.body(),
    quiet: true,
    headers: { Accept: SEEN }, // as the run itself: the format decides what is seen
  });
  return response.json();
}

// { method, knob } from "fir; tail=1e-05".
export function settingOf(headers) {
  const [method, knob] = (headers.get("Lichen-Method") ?? "").split(";").map((each) => each.trim());
  return { method, knob: knob ? Number(knob.split("=")[1]) : null };
}

// { low, high } from "log10; low=1e-9; high=1e-5; untaken=transparent".
function scaleOf(header) {
  const number = (name) => Number(new RegExp(`${name}=([^;]+)`).exec(header ?? "")?.[1]);
  return header ? { low: number("low"), high: number("high") } : null;
}
