// The pictures an operation reads: a field for each, on which a file is dropped or pasted, a sample is chosen, or noise is
// made.

import { fill, h, icon } from "../lib/dom.js";
import { Picture } from "../lib/picture.js";
import { noise, sample, showcase } from "../lib/samples.js";

const NOISE = "noise:"; // what values of the menu begin with that make noise
const TYPES = {
  npy: "application/x-npy",
  exr: "image/x-exr",
  tif: "image/tiff",
  tiff: "image/tiff",
  png: "image/png",
  jpg: "image/jpeg",
  jpeg: "image/jpeg",
  webp: "image/webp",
};

// A file as a picture; its type by its name where the browser does not know it.
export function fromFile(file) {
  const type = file.type.startsWith("image/")
    ? file.type
    : (TYPES[file.name.split(".").pop().toLowerCase()] ?? file.type);
  const picture = new Picture(file.slice(0, file.size, type), file.name);
  picture.file = file.name;
  return picture;
}

// `changed(name, picture)` hears of what was chosen; picture is null where one was taken away.
export function inputs(declared, given, { changed, failed }) {
  const fields = declared.map((each) =>
    each.required || given[each.name] ? field(each, given[each.name], changed, failed) : absent(each, changed, failed),
  );
  const element = h("div", { class: "inputs" }, fields);
  if (!declared.length)
    element.append(h("p", { class: "muted generator" }, "Makes its picture from nothing but parameters."));
  // A file that is meant for no field goes to the first that is a picture, as a photograph is no vector field.
  const first = declared.find((each) => each.picture) ?? declared[0];
  return { element, take: (file) => first && changed(first.name, fromFile(file)) };
}

// An input that may be left out, until somebody wants it.
function absent(declared, changed, failed) {
  const slot = h(
    "div",
    { class: "absent" },
    h(
      "button",
      {
        type: "button",
        class: "add",
        title: declared.description,
        onclick: () => {
          slot.replaceWith(field(declared, undefined, changed, failed));
        },
      },
      icon("plus"),
      declared.name,
    ),
  );
  return slot;
}

function field(declared, picture, changed, failed) {
  const file = h("input", {
    type: "file",
    class: "visually-hidden",
    tabindex: -1,
    "aria-hidden": "true",
    accept: "image/*,.exr,.npy,.tif,.tiff",
  });
  const look = h("span", { class: "thumb small" });
  const title = picture ? picture.title : declared.required ? "drop a picture" : "none";
  const choose = h(
    "select",
    { class: "sample", "aria-label": `${declared.name}: choose a sample or a file` },
    h("option", { value: "" }, title),
  );
  const drop = h(
    "div",
    { class: "drop", title: declared.description },
    look,
    h(
      "div",
      { class: "drop-text" },
      h(
        "span",
        { class: "drop-name" },
        declared.name,
        declared.required ? "" : h("span", { class: "muted" }, " optional"),
      ),
      choose,
    ),
    h(
      "button",
      {
        type: "button",
        class: "tool",
        title: "open a file",
        "aria-label": `${declared.name}: open a file`,
        onclick: () => file.click(),
      },
      icon("upload"),
    ),
    file,
  );
  const take = (chosen) => changed(declared.name, chosen);
  file.addEventListener("change", () => {
    if (file.files[0]) take(fromFile(file.files[0]));
  });
  choose.addEventListener("change", async () => {
    if (choose.value === "none") return take(null);
    if (choose.value === "file") {
      choose.value = "";
      return file.click();
    }
    try {
      if (choose.value.startsWith(NOISE)) return take(await noise(choose.value.slice(NOISE.length)));
      return take(await sample(choose.value));
    } catch (failure) {
      return failed(failure);
    }
  });
  drop.addEventListener("dragover", (event) => {
    event.preventDefault();
    drop.classList.add("over");
  });
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", (event) => {
    event.preventDefault();
    event.stopPropagation();
    drop.classList.remove("over");
    if (event.dataTransfer.files[0]) take(fromFile(event.dataTransfer.files[0]));
  });
  showcase()
    .then(({ samples, noise: kinds }) =>
      choose.append(
        h(
          "optgroup",
          { label: "Samples" },
          samples.map((each) => h("option", { value: each.name }, each.title)),
        ),
        h(
          "optgroup",
          { label: "Noise, another each time" },
          Object.entries(kinds).map(([name, { title }]) => h("option", { value: `${NOISE}${name}` }, title)),
        ),
        h(
          "optgroup",
          { label: "Your own" },
          h("option", { value: "file" }, "Open a file …"),
          declared.required ? null : h("option", { value: "none" }, "None"),
        ),
      ),
    )
    .catch(failed);
  if (picture)
    picture
      .look()
      .then((seen) => fill(look, small(seen)))
      .catch(failed);
  return drop;
}

function small({ bitmaps: [bitmap], width, height }) {
  const canvas = h("canvas", { width: 96, height: 72, "aria-hidden": "true" });
  const k = Math.max(96 / width, 72 / height);
  canvas.getContext("2d").drawImage(bitmap, (96 - width * k) / 2, (72 - height * k) / 2, width * k, height * k);
  return canvas;
}
