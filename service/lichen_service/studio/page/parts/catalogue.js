// All operations by family, with a picture each, and a search over names, families and summaries.

import { fill, h, icon } from "../lib/dom.js";
import { loaded, Queue, seen } from "../lib/queue.js";
import { link } from "../lib/router.js";

export function catalogue(operations, { chosen }) {
  const search = h("input", {
    type: "search",
    class: "search",
    placeholder: "Search operations",
    "aria-label": "Search operations",
    autocomplete: "off",
    spellcheck: "false",
  });
  const families = [...new Set(operations.map((each) => each.family))];
  let family = "";
  const menu = h(
    "select",
    {
      "aria-label": "Family",
      onchange: () => {
        family = menu.value;
        show();
      },
    },
    h("option", { value: "" }, `All ${families.length} families`),
    families.map((name) => h("option", { value: name }, name)),
  );
  const list = h("div", { class: "catalogue-list" });
  const count = h("p", { class: "visually-hidden", role: "status" });
  const queue = new Queue();
  const inView = (item) => {
    const [box, place] = [list, item].map((each) => each.getBoundingClientRect());
    return item.isConnected && place.bottom > box.top && place.top < box.bottom;
  };
  const watcher = seen(list, (item) =>
    queue.add(
      () => {
        const picture = item.querySelector("img");
        picture.hidden = false;
        return loaded(picture, `/studio/thumbnails/${picture.dataset.name}`);
      },
      () => inView(item),
    ),
  );
  const items = new Map(operations.map((each) => [each.name, item(each)]));

  function item(each) {
    const picture = h("img", {
      alt: "",
      width: 80,
      height: 60,
      decoding: "async",
      "data-name": each.name,
      hidden: true,
    });
    return h(
      "a",
      { class: "operation", href: link("try", each.name), "data-operation": each.name },
      h("span", { class: "thumb" }, picture),
      h(
        "span",
        { class: "operation-text" },
        h("span", { class: "operation-name" }, each.name),
        h("span", { class: "operation-about" }, each.summary),
      ),
    );
  }

  function show() {
    const wanted = search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    const found = operations.filter(
      (each) =>
        (!family || each.family === family) &&
        wanted.every((word) => `${each.name} ${each.family} ${each.summary}`.toLowerCase().includes(word)),
    );
    const sections = families
      .map((name) => [name, found.filter((each) => each.family === name)])
      .filter(([, some]) => some.length);
    fill(
      list,
      sections.map(([name, some]) =>
        h(
          "section",
          { "aria-label": name },
          h("h3", name),
          h(
            "ul",
            some.map((each) => h("li", items.get(each.name))),
          ),
        ),
      ),
    );
    if (!found.length)
      fill(list, h("p", { class: "muted nothing" }, `No operation is called “${search.value}” or says so of itself.`));
    count.textContent = `${found.length} operations`;
  }

  search.addEventListener("input", show);
  search.addEventListener("keydown", (event) => {
    if (event.key === "Enter") list.querySelector("a")?.click();
    if (event.key === "ArrowDown") {
      list.querySelector("a")?.focus();
      event.preventDefault();
    }
  });
  list.addEventListener("keydown", (event) => {
    const all = [...list.querySelectorAll("a")];
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    (all[all.indexOf(document.activeElement) + step] ?? search).focus();
    event.preventDefault();
  });
  list.addEventListener("click", (event) => {
    if (event.target.closest("a")) chosen();
  });
  show();

  const mark = (name) => {
    for (const [key, element] of items) {
      if (key === name) element.setAttribute("aria-current", "page");
      else element.removeAttribute("aria-current");
    }
    const current = items.get(name);
    const box = list.getBoundingClientRect();
    const place = current?.getBoundingClientRect();
    if (place?.height && (place.top < box.top || place.bottom > box.bottom))
      list.scrollTop += place.top - box.top - box.height / 3;
  };
  const element = h(
    "div",
    { class: "catalogue" },
    h("div", { class: "catalogue-head" }, h("label", { class: "search-box" }, icon("search"), search), menu, count),
    list,
  );
  for (const each of items.values()) watcher.observe(each);
  return { element, mark, focus: () => search.focus(), draw: () => queue.open() };
}
