// The same request elsewhere: as curl, as Python, as an address; and the result as a file in any format.

import { request } from "../lib/api.js";
import { fill, h, icon } from "../lib/dom.js";
import { asCurl, asPython } from "../lib/order.js";
import { segments } from "./controls.js";

export function use({ formats, failed }) {
  let order = null;
  let shown = "curl";
  let format = "png";
  const code = h("pre", { tabindex: 0, "aria-label": "the request as text" });
  const done = h("span", { class: "done", role: "status" });
  const kinds = segments(
    { choices: ["curl", "python", "url"], titles: { curl: "curl", python: "Python", url: "URL" } },
    {
      label: "Copy as",
      value: shown,
      changed: (kind) => {
        shown = kind;
        write();
      },
    },
  );
  const menu = h(
    "select",
    {
      "aria-label": "format of the file",
      onchange: () => {
        format = menu.value;
        write();
      },
    },
    formats.map((each) => h("option", { value: each.name }, each.name.toUpperCase())),
  );
  const copy = h("button", { type: "button", class: "plain", onclick: copied }, icon("copy"), "Copy");
  const save = h("button", { type: "button", class: "plain", onclick: saved }, icon("download"), "Download");
  const element = h(
    "section",
    { class: "use", "aria-labelledby": "use-title" },
    h(
      "div",
      { class: "use-head" },
      h("h2", { id: "use-title" }, "Use it"),
      kinds.element,
      copy,
      done,
      h("span", { class: "spring" }),
      menu,
      save,
    ),
    code,
  );

  async function text() {
    if (shown === "curl") return asCurl(order, location.origin, format);
    return shown === "python" ? asPython(order, location.origin) : address();
  }

  // An address stands for itself only when its pictures are stored under names: they are, then.
  async function address() {
    const named = [];
    for (const [name, picture] of Object.entries(order.inputs)) {
      if (!picture) continue;
      const response = await request("PUT", "/v1/assets", {
        body: picture.blob,
        headers: { "Content-Type": picture.blob.type || "application/octet-stream" },
      });
      named.push([name, (await response.json()).id]);
    }
    const query = [...order.query(), ...named, ["format", format]];
    return `${location.origin}${order.path}?${new URLSearchParams(query)}`;
  }

  async function write() {
    if (!order) return;
    const mine = shown;
    if (shown === "url" && Object.values(order.inputs).some(Boolean)) code.textContent = "storing the pictures …";
    try {
      const said = await text();
      if (mine === shown) code.textContent = said;
    } catch (failure) {
      code.textContent = "";
      failed(failure);
    }
  }

  async function copied() {
    try {
      await navigator.clipboard.writeText(code.textContent);
      done.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(code);
      done.textContent = "selected: press Ctrl+C";
    }
    setTimeout(() => {
      done.textContent = "";
    }, 2500);
  }

  async function saved() {
    try {
      const response = await request("POST", order.path, {
        query: [...order.query(), ["format", format]],
        body: order.body(),
      });
      const url = URL.createObjectURL(await response.blob());
      const link = h("a", { href: url, download: `${order.name}.${format}` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
    } catch (failure) {
      failed(failure);
    }
  }

  return {
    element,
    show(now) {
      order = now;
      write();
    },
  };
}
