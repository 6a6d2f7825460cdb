// Where in the page we are, as the part of the address behind "#": "#/try/gaussian?sigma=6".

export function here() {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const [view = "", name = ""] = path.split("/").map(decodeURIComponent);
  return { view: view || "try", name, query: [...new URLSearchParams(query)] };
}

export const link = (view, name = "", query = []) =>
  `#/${view}${name ? `/${encodeURIComponent(name)}` : ""}${query.length ? `?${new URLSearchParams(query)}` : ""}`;

// Says where we are without a step in the history: parameters change with every movement of a slider.
export function say(view, name, query) {
  const now = here();
  if (now.name && now.name !== name) return; // the visitor is already on the way to somewhere else
  const wanted = link(view, name, query);
  if (location.hash !== wanted) history.replaceState(null, "", wanted);
}
