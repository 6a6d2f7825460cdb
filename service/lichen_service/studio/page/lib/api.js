// The service as any client knows it. Every request of the page goes through `request`, which keeps the key, remembers
// what was asked for the status page, and turns what goes wrong into a `Problem`.

const KEY = "lichen-key";
const REMEMBERED = 60;

export const log = [];
export const events = new EventTarget(); // "answered", "lost", "found", "key"

// What is wrong, as the service explained it (RFC 9457), or as much as can be said without it.
export class Problem extends Error {
  constructor({ title, detail, status = 0, code = "", errors = [] }) {
    super(detail ?? title);
    Object.assign(this, { title, detail, status, code, errors });
  }
}

export const key = () => sessionStorage.getItem(KEY) ?? "";
export function setKey(value) {
  if (value) sessionStorage.setItem(KEY, value);
  else sessionStorage.removeItem(KEY);
  events.dispatchEvent(new Event("key"));
}

export const address = (path, query = []) => (query.length ? `${path}?${new URLSearchParams(query)}` : path);

// The answer, whatever its status is below 400. `quiet` requests are not remembered.
export async function request(method, path, { query = [], body, headers = {}, signal, quiet = false } = {}) {
  const began = performance.now();
  const asked = { method, path: address(path, query), began: new Date() };
  const token = key();
  let response;
  try {
    response = await fetch(asked.path, {
      method,
      body,
      signal,
      headers: { ...headers, ...(token ? { Authorization: `Bearer ${token}` } : {}) },
    });
  } catch (failure) {
    if (failure.name === "AbortError") throw failure;
    lose();
    throw new Problem({ title: "The service does not answer", detail: "It will be asked again until it does." });
  }
  find();
  if (!quiet) remember(asked, response, performance.now() - began);
  if (response.ok || response.status === 304) return response;
  throw await problem(response);
}

export const json = async (path, options) => (await request("GET", path, options)).json();

function remember(asked, response, took) {
  log.unshift({ ...asked, status: response.status, took, timing: response.headers.get("Server-Timing") ?? "" });
  log.length = Math.min(log.length, REMEMBERED);
  events.dispatchEvent(new Event("answered"));
}

async function problem(response) {
  const type = response.headers.get("Content-Type") ?? "";
  const told = type.startsWith("application/problem+json") ? await response.json() : { title: response.statusText };
  if (response.status === 401) events.dispatchEvent(new Event("key"));
  return new Problem({ ...told, status: response.status });
}

// A service that is away is asked for until it is back.
let lost = false;
function lose() {
  if (lost) return;
  lost = true;
  events.dispatchEvent(new Event("lost"));
  setTimeout(ask, 400);
}
async function ask() {
  try {
    if ((await fetch("/livez", { cache: "no-store" })).ok) return find();
  } catch {
    /* still away */
  }
  if (lost) setTimeout(ask, 800);
}
function find() {
  if (!lost) return;
  lost = false;
  events.dispatchEvent(new Event("found"));
}

// What Server-Timing says: [[name, milliseconds]].
export function stages(header) {
  return (header ?? "")
    .split(",")
    .map((each) => /([^;\s]+);dur=([\d.]+)/.exec(each))
    .filter(Boolean)
    .map(([, name, time]) => [name, Number(time)]);
}
