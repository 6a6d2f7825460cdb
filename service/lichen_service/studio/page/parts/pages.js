// The pages of a picture that has several: played one after another as an animation, or leafed through by hand.

import { fill, h, icon } from "../lib/dom.js";

const PACE = 1000 / 15; // ms that each page is seen for
const MOVING = 8; // pages from which they are taken for an animation, and played at once

// `turned(page)` hears which page is to be seen.
export function pages(turned) {
  let count = 1;
  let timer = 0;
  const slider = h("input", { type: "range", class: "slider", min: 0, step: 1, "aria-label": "page" });
  const where = h("output", { class: "page-number" });
  const player = h("button", { type: "button", class: "tool", onclick: () => (timer ? stop() : play()) });
  const about = { class: "pages", role: "group", "aria-label": "Pages", hidden: true };
  const element = h("div", about, player, slider, where);

  function turn(page) {
    slider.value = page;
    slider.style.setProperty("--filled", `${(100 * page) / Math.max(1, count - 1)}%`);
    slider.setAttribute("aria-valuetext", `${page + 1} of ${count}`);
    where.textContent = `${page + 1} / ${count}`;
    turned(page);
  }

  function play() {
    stop();
    timer = setInterval(() => turn((Number(slider.value) + 1) % count), PACE);
    mark();
  }

  function stop() {
    clearInterval(timer);
    timer = 0;
    mark();
  }

  function mark() {
    const label = timer ? "stop at this page" : "play the pages";
    fill(player, icon(timer ? "pause" : "play"));
    player.title = label;
    player.setAttribute("aria-label", label);
  }

  slider.addEventListener("input", () => {
    stop();
    turn(Number(slider.value));
  });
  mark();

  return {
    element,
    stop,
    // What is shown has this many pages now. The page that was seen stays, where there still is one.
    show(now) {
      const before = count;
      count = now;
      element.hidden = count < 2;
      slider.max = count - 1;
      if (count < 2) stop();
      turn(Math.min(Number(slider.value), count - 1) % count);
      const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
      if (count >= MOVING && before !== count && !still) play();
      else if (before !== count) stop();
    },
  };
}
