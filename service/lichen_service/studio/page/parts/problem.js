// What went wrong, in the service's own words: title, detail, and every bad field.

import { h, icon } from "../lib/dom.js";
import { Problem } from "../lib/api.js";

export function problem(failure, left = failure.errors ?? []) {
  const known = failure instanceof Problem;
  if (!known) console.warn(failure);
  return h(
    "div",
    { class: "problem", role: "alert" },
    h("span", { class: "problem-mark" }, icon("cross")),
    h(
      "div",
      h("strong", known ? failure.title : "The page could not do this"),
      h("p", known ? failure.detail : failure.message),
      left.length
        ? h(
            "ul",
            left.map((each) => h("li", h("code", each.pointer), ` ${each.detail}`)),
          )
        : null,
    ),
  );
}
