// The frame of the page: which view is shown, dark or light, the key, and word that the service is away.

import { events, setKey } from "./lib/api.js";
import { fill, h, icon } from "./lib/dom.js";
import { here } from "./lib/router.js";
import { problem } from "./parts/problem.js";
import * as api from "./views/api.js";
import * as cases from "./views/cases.js";
import * as pipelines from "./views/pipelines.js";
import * as scenes from "./views/scenes.js";
import * as status from "./views/status.js";
import * as tried from "./views/try.js";

const VIEWS = { try: tried, pipelines, scenes, cases, api, status };
const THEME = "lichen-theme";
const root = document.getElementById("main");
let shown = { name: "", view: null };

async function show() {
  const place = here();
  const name = place.view in VIEWS ? place.view : "try";
  for (const each of document.querySelectorAll("nav.views a")) {
    if (each.dataset.view === name) each.setAttribute("aria-current", "page");
    else each.removeAttribute("aria-current");
  }
  try {
    if (shown.name !== name) {
      shown.view?.unmount?.();
      shown = { name, view: null };
      const slot = h("div", { class: `view view-${name}` });
      const view = await VIEWS[name].mount(slot);
      if (here().view !== place.view) return view.unmount?.();
      fill(root, slot);
      shown = { name, view };
    }
    await shown.view?.open?.(here());
  } catch (failure) {
    shown = { name: "", view: null };
    fill(root, h("div", { class: "view narrow" }, problem(failure)));
  }
  return undefined;
}

// A view that could not be opened is tried again when the service is back, or a key was given.
function retry() {
  if (!shown.view) show();
}

function theme() {
  const button = document.getElementById("theme");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const set = (wanted) => {
    document.documentElement.dataset.theme = wanted;
    button.setAttribute("aria-label", wanted === "dark" ? "switch to light" : "switch to dark");
  };
  set(localStorage.getItem(THEME) ?? (dark.matches ? "dark" : "light"));
  dark.addEventListener("change", () => {
    if (!localStorage.getItem(THEME)) set(dark.matches ? "dark" : "light");
  });
  fill(button, icon("sun"));
  button.addEventListener("click", () => {
    const wanted = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    localStorage.setItem(THEME, wanted);
    set(wanted);
  });
}

function door() {
  const dialog = document.getElementById("key");
  const field = document.getElementById("key-field");
  let asked = false;
  events.addEventListener("key", () => {
    if (!dialog.open && !asked) {
      asked = true;
      dialog.showModal();
    }
  });
  dialog.addEventListener("close", () => {
    asked = false;
    if (dialog.returnValue !== "use" || !field.value) return;
    asked = true; // what this sets off is no reason to ask again
    setKey(field.value.trim());
    asked = false;
    field.value = "";
    shown.view?.unmount?.();
    shown = { name: "", view: null };
    show();
  });
}

const away = document.getElementById("away");
events.addEventListener("lost", () => {
  away.hidden = false;
});
events.addEventListener("found", () => {
  away.hidden = true;
  retry();
});
addEventListener("hashchange", show);
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  root.focus();
});
theme();
door();
show();
