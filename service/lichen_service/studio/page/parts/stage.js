// Where pictures are looked at: result, input, both with a line to swipe, or beside one another; zoomed down to pixels,
// with the floats under the pointer. One canvas draws all of it.

import { fill, h, icon } from "../lib/dom.js";
import { sample } from "../lib/numbers.js";
import { segments } from "./controls.js";
import { pages } from "./pages.js";

const DEEPEST = 64; // screen pixels for each pixel of the picture
const GRID = 12; // from here on pixels are outlined

// `over` lies over the picture, at its top.
export function stage({ probed, over = null }) {
  const canvas = h("canvas", { class: "stage-canvas", tabindex: 0, role: "img", "aria-label": "nothing yet" });
  const swipe = h("input", {
    type: "range",
    min: 0,
    max: 1000,
    value: 500,
    class: "swipe",
    "aria-label": "line between input and result",
  });
  const readout = h("output", { class: "readout", "aria-live": "off" });
  const veil = h("div", { class: "stage-veil", role: "status", hidden: true });
  const zoomText = h("span", { class: "zoom-text" });
  const box = h("div", { class: "stage-box" }, canvas, swipe, veil, over);
  const state = {
    result: null,
    input: null,
    overlay: null,
    opacity: 0.85,
    mode: "result",
    zoom: 0,
    x: 0.5,
    y: 0.5,
    page: 0,
    probe: null,
    floats: null,
    inputFloats: null,
  };
  const modes = segments(
    { choices: ["result", "swipe", "both", "input"], titles: { both: "side by side" } },
    {
      label: "What is shown",
      value: "result",
      changed: (mode) => {
        state.mode = mode;
        laid();
      },
    },
  );
  const button = (name, label, act) =>
    h("button", { type: "button", class: "tool", title: label, "aria-label": label, onclick: act }, icon(name));
  const bar = h(
    "div",
    { class: "stage-bar" },
    modes.element,
    h(
      "div",
      { class: "tools" },
      button("minus", "zoom out", () => zoomBy(0.5)),
      zoomText,
      button("plus", "zoom in", () => zoomBy(2)),
      button("fit", "fit the picture", () => fit()),
    ),
  );
  const leaves = pages((page) => {
    state.page = page;
    tell();
    draw();
  });
  const element = h("div", { class: "stage" }, bar, box, leaves.element, readout);

  const size = () => state.result ?? state.input ?? { width: 1, height: 1 };
  const panes = () => (state.mode === "both" && state.input ? 2 : 1);
  const view = () => ({ width: box.clientWidth / panes(), height: box.clientHeight });
  const fitting = () => Math.min(view().width / size().width, view().height / size().height);
  const scale = () => (state.zoom > 0 ? state.zoom : fitting());

  // The place of the picture in its pane, in CSS pixels.
  function frame() {
    const k = scale();
    const { width, height } = view();
    return { k, left: width / 2 - state.x * size().width * k, top: height / 2 - state.y * size().height * k };
  }

  let waiting = false;
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      paint();
    });
  }

  function paint() {
    const dense = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(box.clientWidth * dense), Math.round(box.clientHeight * dense)];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!state.result && !state.input) return;
    pen.scale(dense, dense);
    const at = frame();
    zoomText.textContent = `${Math.round(at.k * 100)} %`;
    const line = state.mode === "swipe" ? (Number(swipe.value) / 1000) * box.clientWidth : null;
    const { width: pane, height: tall } = view();
    const second = state.result ?? state.input;
    if (state.mode === "both" && state.input) {
      clipped(pen, 0, pane, tall, () => picture(pen, state.input, at, 0));
      clipped(pen, pane, pane, tall, () => picture(pen, second, at, pane, true));
      pen.fillStyle = "rgba(128,128,128,.6)";
      pen.fillRect(pane - 0.5, 0, 1, tall);
    } else if (state.mode === "swipe" && state.input) {
      clipped(pen, 0, line, tall, () => picture(pen, state.input, at, 0));
      clipped(pen, line, pane - line, tall, () => picture(pen, second, at, 0, true));
      handle(pen, line, tall);
    } else picture(pen, state.mode === "input" ? (state.input ?? second) : second, at, 0, state.mode !== "input");
    cross(pen, at);
  }

  function clipped(pen, left, width, height, work) {
    pen.save();
    pen.beginPath();
    pen.rect(left, 0, Math.max(0, width), height);
    pen.clip();
    work();
    pen.restore();
  }

  function picture(pen, which, { k, left, top }, shift, overlaid = false) {
    if (!which) return;
    const { width, height } = size();
    const missing = overlaid && !state.result; // the input stands in, faintly, where there is no result
    checker(pen, left + shift, top, width * k, height * k);
    pen.imageSmoothingEnabled = k < 2;
    pen.imageSmoothingQuality = "high";
    pen.globalAlpha = missing ? 0.25 : 1;
    pen.drawImage(which.bitmaps[Math.min(state.page, which.bitmaps.length - 1)], left + shift, top, width * k, height * k);
    pen.globalAlpha = 1;
    if (overlaid && state.overlay) {
      pen.globalAlpha = state.opacity;
      pen.drawImage(state.overlay, left + shift, top, width * k, height * k);
      pen.globalAlpha = 1;
    }
    if (k >= GRID) outlines(pen, width, height, k, left + shift, top);
  }

  // What shows through where the picture covers nothing.
  function checker(pen, left, top, width, height) {
    pen.fillStyle = "#c4c8c1";
    pen.fillRect(left, top, width, height);
    pen.save();
    pen.beginPath();
    pen.rect(left, top, width, height);
    pen.clip();
    pen.fillStyle = "#989d96";
    for (let y = Math.max(top, 0), row = 0; y < Math.min(top + height, box.clientHeight); y += 10, row += 1) {
      for (let x = Math.max(left, 0) + (row % 2) * 10; x < Math.min(left + width, box.clientWidth); x += 20)
        pen.fillRect(x, y, 10, 10);
    }
    pen.restore();
  }

  function outlines(pen, width, height, k, left, top) {
    pen.strokeStyle = "rgba(128,128,128,.35)";
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = Math.max(0, Math.floor(-left / k)); x <= width && left + x * k < box.clientWidth; x += 1) {
      pen.moveTo(left + x * k, Math.max(0, top));
      pen.lineTo(left + x * k, Math.min(box.clientHeight, top + height * k));
    }
    for (let y = Math.max(0, Math.floor(-top / k)); y <= height && top + y * k < box.clientHeight; y += 1) {
      pen.moveTo(Math.max(0, left), top + y * k);
      pen.lineTo(Math.min(box.clientWidth, left + width * k), top + y * k);
    }
    pen.stroke();
  }

  function handle(pen, line, tall) {
    pen.fillStyle = "rgba(0,0,0,.55)";
    pen.fillRect(line - 1.5, 0, 3, tall);
    pen.fillStyle = "#fff";
    pen.fillRect(line - 0.5, 0, 1, tall);
    pen.font = "600 11px system-ui, sans-serif";
    label(pen, "input", line - 8, "right");
    label(pen, "result", line + 8, "left");
  }

  function label(pen, text, x, align) {
    const width = pen.measureText(text).width + 10;
    pen.fillStyle = "rgba(0,0,0,.62)";
    pen.fillRect(align === "left" ? x : x - width, 8, width, 19);
    pen.fillStyle = "#fff";
    pen.textAlign = align;
    pen.fillText(text, align === "left" ? x + 5 : x - 5, 21);
  }

  function cross(pen, { k, left, top }) {
    if (!state.probe || k < 3) return;
    pen.strokeStyle = "#000";
    pen.lineWidth = 3;
    pen.strokeRect(left + state.probe.x * k, top + state.probe.y * k, k, k);
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1;
    pen.strokeRect(left + state.probe.x * k, top + state.probe.y * k, k, k);
  }

  function place(event) {
    const edge = box.getBoundingClientRect();
    const { k, left, top } = frame();
    const across = (event.clientX - edge.left) % (edge.width / panes());
    return { x: Math.floor((across - left) / k), y: Math.floor((event.clientY - edge.top - top) / k) };
  }

  function probe(point) {
    const { width, height } = size();
    const inside = point && point.x >= 0 && point.y >= 0 && point.x < width && point.y < height;
    state.probe = inside ? point : null;
    if (inside) probed();
    tell();
    draw();
  }

  function tell() {
    if (!state.probe)
      return fill(
        readout,
        h("span", { class: "muted" }, "Point at a pixel to read its samples; wheel or + and − to zoom."),
      );
    const { x, y } = state.probe;
    return fill(
      readout,
      h("span", { class: "where" }, `x ${x}  y ${y}`),
      samples("result", state.floats, x, y),
      samples("input", state.inputFloats, x, y),
    );
  }

  function samples(name, floats, x, y) {
    if (!floats || x >= floats.width || y >= floats.height) return null;
    const page = Math.min(state.page, floats.pages - 1);
    const from = ((page * floats.height + y) * floats.width + x) * floats.channels;
    const values = [...floats.data.subarray(from, from + Math.min(floats.channels, 4))];
    return h(
      "span",
      { class: "samples" },
      h("span", { class: "muted" }, name),
      values.map((each) => h("b", sample(each))),
    );
  }

  function zoomTo(wanted, event) {
    const before = event && place(event);
    const least = fitting();
    state.zoom = Math.min(DEEPEST, Math.max(wanted, Math.min(least, 1)));
    if (state.zoom <= least * 1.001) return fit();
    if (before) {
      const after = place(event);
      state.x += (before.x - after.x) / size().width;
      state.y += (before.y - after.y) / size().height;
    }
    keep();
    return draw();
  }
  const zoomBy = (factor, event) => zoomTo(scale() * factor, event);
  const keep = () => {
    for (const axis of ["x", "y"]) state[axis] = Math.min(1, Math.max(0, state[axis]));
  };
  function fit() {
    Object.assign(state, { zoom: 0, x: 0.5, y: 0.5 });
    draw();
  }

  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoomBy(2 ** (-event.deltaY / 240), event);
    },
    { passive: false },
  );
  const pointers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
    probe(place(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return probe(place(event));
    pointers.set(event.pointerId, event);
    if (pointers.size === 2) return pinch(before, event);
    if (state.zoom > 0) {
      state.x -= (event.clientX - before.clientX) / (size().width * scale());
      state.y -= (event.clientY - before.clientY) / (size().height * scale());
      keep();
      return draw();
    }
    return probe(place(event));
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", (event) => {
    if (event.pointerType === "mouse") probe(null);
  });

  function pinch(before, event) {
    const other = [...pointers.entries()].find(([id]) => id !== event.pointerId)[1];
    const span = (each) => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY);
    zoomBy(span(event) / Math.max(1, span(before)), event);
  }

  canvas.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 10 : 1;
    const by = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
    if (by) {
      const { width, height } = size();
      const from = state.probe ?? { x: Math.floor(state.x * width), y: Math.floor(state.y * height) };
      const to = {
        x: Math.min(width - 1, Math.max(0, from.x + by[0])),
        y: Math.min(height - 1, Math.max(0, from.y + by[1])),
      };
      if (state.zoom > 0) Object.assign(state, { x: (to.x + 0.5) / width, y: (to.y + 0.5) / height });
      probe(to);
    } else if (event.key === "+" || event.key === "=") zoomBy(2);
    else if (event.key === "-") zoomBy(0.5);
    else if (event.key === "0") fit();
    else return;
    event.preventDefault();
  });
  swipe.addEventListener("input", draw);
  new ResizeObserver(draw).observe(box);

  function laid() {
    swipe.hidden = state.mode !== "swipe" || !state.input;
    draw();
  }
  laid();
  tell();

  return {
    element,
    canvas,
    // Pictures are { bitmaps, width, height }; floats { data, width, height, channels, pages }.
    show(changes) {
      const before = size();
      Object.assign(state, changes);
      const now = size();
      if (before.width !== now.width || before.height !== now.height) fit();
      if ("result" in changes || "input" in changes) leaves.show(now.bitmaps?.length ?? 1);
      modes.element.classList.toggle("lonely", !state.input);
      if (!state.input && state.mode !== "result") {
        state.mode = "result";
        modes.set("result");
      }
      if ("result" in changes && state.result)
        canvas.setAttribute(
          "aria-label",
          `Result, ${now.width} by ${now.height} pixels${now.bitmaps.length > 1 ? `, ${now.bitmaps.length} pages` : ""}. Arrow keys read pixels, plus and minus zoom.`,
        );
      laid();
      tell();
    },
    stop: leaves.stop,
    say(content) {
      fill(veil, content);
      veil.hidden = !content;
    },
    busy(on) {
      box.classList.toggle("busy", on);
    },
  };
}
