// The API, from /openapi.json: every path with its parameters, bodies and answers. A path is drawn when it is opened.

import { json } from "../lib/api.js";
import { fill, h } from "../lib/dom.js";
import { link } from "../lib/router.js";

const METHODS = ["get", "post", "put", "delete"];

export async function mount(root) {
  const document = await json("/openapi.json", { quiet: true });
  const entries = Object.entries(document.paths).flatMap(([path, item]) =>
    METHODS.filter((each) => item[each]).map((method) => ({ path, method, ...item[method] })),
  );
  const groups = new Map();
  for (const each of entries) {
    const group = each.tags?.[0] ?? "service";
    groups.set(group, [...(groups.get(group) ?? []), each]);
  }
  const search = h("input", {
    type: "search",
    class: "search",
    placeholder: "Search paths",
    "aria-label": "Search paths",
    oninput: () => show(),
  });
  const list = h("div", { class: "paths" });
  const show = () => {
    const wanted = search.value.trim().toLowerCase();
    const found = [...groups]
      .sort(([a], [b]) => (a === "service" ? -1 : b === "service" ? 1 : a.localeCompare(b)))
      .map(([name, all]) => [
        name,
        all.filter((each) => !wanted || `${each.path} ${each.summary}`.toLowerCase().includes(wanted)),
      ])
      .filter(([, all]) => all.length);
    fill(
      list,
      found.map(([name, all]) =>
        h(
          "section",
          h("h2", name),
          all.map((each) => entry(each, document)),
        ),
      ),
    );
    if (!found.length) fill(list, h("p", { class: "muted" }, "No path says so."));
  };
  show();
  fill(
    root,
    h(
      "div",
      { class: "wide-page" },
      h("h1", "API"),
      h("p", { class: "lead" }, document.info.description),
      h(
        "p",
        { class: "muted" },
        `OpenAPI ${document.openapi}, version ${document.info.version}: `,
        h("a", { href: "/openapi.json" }, "/openapi.json"),
        ". Errors are problem documents (RFC 9457) that name every bad field.",
      ),
      search,
      list,
    ),
  );
  return {};
}

function entry(each, document) {
  const body = h("div", { class: "path-body" });
  const details = h(
    "details",
    { class: "path" },
    h(
      "summary",
      h("span", { class: `verb verb-${each.method}` }, each.method.toUpperCase()),
      h("code", each.path),
      h("span", { class: "muted" }, each.summary),
    ),
    body,
  );
  details.addEventListener("toggle", () => {
    if (details.open && !body.firstChild) fill(body, drawn(each, document));
  });
  return details;
}

function drawn(each, document) {
  const operation = /^\/v1\/operations\/(\w+)$/.exec(each.path)?.[1];
  const parameters = each.parameters ?? [];
  const media = Object.keys(each.requestBody?.content ?? {});
  const answers = Object.entries(each.responses).map(([status, said]) => [status, resolved(said, document)]);
  return [
    operation && each.method === "post" ? h("p", h("a", { href: link("try", operation) }, `Try ${operation}`)) : null,
    each.description ? h("pre", { class: "description" }, each.description.trim()) : null,
    parameters.length
      ? h(
          "div",
          { class: "scroll", tabindex: 0, role: "region", "aria-label": "Parameters" },
          h(
            "table",
            { class: "parameters" },
            h(
              "thead",
              h(
                "tr",
                ["name", "type", "default", "what it is"].map((one) => h("th", { scope: "col" }, one)),
              ),
            ),
            h(
              "tbody",
              parameters.map((one) =>
                h(
                  "tr",
                  h(
                    "th",
                    { scope: "row" },
                    h("code", one.name),
                    one.required ? h("b", { title: "required" }, " *") : null,
                  ),
                  h("td", type(schema(one))),
                  h("td", preset(schema(one))),
                  h("td", one.description ?? ""),
                ),
              ),
            ),
          ),
        )
      : null,
    media.length ? h("p", h("b", "Body: "), media.join(", ")) : null,
    h(
      "ul",
      { class: "answers" },
      answers.map(([status, said]) =>
        h(
          "li",
          h("b", status === "default" ? "any other" : status),
          ` ${said.description}`,
          said.content ? h("span", { class: "muted" }, ` ${Object.keys(said.content).join(", ")}`) : null,
        ),
      ),
    ),
  ];
}

const schema = (parameter) => parameter.schema ?? parameter.content?.["application/json"]?.schema ?? {};
const preset = (each) => (each.default === undefined ? "" : h("code", JSON.stringify(each.default)));

function resolved(said, document) {
  const name = /^#\/components\/responses\/(\w+)$/.exec(said.$ref ?? "")?.[1];
  return name ? document.components.responses[name] : said;
}

function type(each) {
  if (each.enum) return each.enum.map(String).join(" | ");
  if (each.anyOf) return each.anyOf.map(type).join(" or ");
  const low = each.minimum ?? each.exclusiveMinimum;
  const high = each.maximum ?? each.exclusiveMaximum;
  const range = low !== undefined || high !== undefined ? ` ${low ?? "−∞"} … ${high ?? "∞"}` : "";
  return `${each.type === "array" || each.prefixItems ? "JSON array" : (each.type ?? "any")}${range}${each.unit ? ` ${each.unit}` : ""}`;
}
