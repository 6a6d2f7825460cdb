// What may wait is done one after another, once the visitor has what they came for: pictures of a catalogue would
// otherwise take every thread of the service while somebody waits for a result.

export class Queue {
  #waiting = [];
  #going = false;
  #open = false;

  // `work` returns a promise; what it says does not matter. What is `wanted` when its turn might come goes first.
  add(work, wanted = () => false) {
    this.#waiting.push({ work, wanted });
    this.#go();
  }

  #next() {
    const first = this.#waiting.findIndex(({ wanted }) => wanted());
    return this.#waiting.splice(Math.max(0, first), 1)[0];
  }

  // From here on what waits is done.
  open() {
    this.#open = true;
    this.#go();
  }

  async #go() {
    if (!this.#open || this.#going) return;
    this.#going = true;
    while (this.#waiting.length) {
      try {
        await this.#next().work();
      } catch (failure) {
        console.info(failure);
      }
    }
    this.#going = false;
  }
}

// An image from an address, when it has come or it is known that it will not.
export function loaded(image, address) {
  return new Promise((done) => {
    image.addEventListener("load", done, { once: true });
    image.addEventListener(
      "error",
      () => {
        image.hidden = true;
        done();
      },
      { once: true },
    );
    image.src = address;
  });
}

// Calls `act` once for each element when it comes near to what is seen of `root`.
export function seen(root, act) {
  const watcher = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        watcher.unobserve(target);
        act(target);
      }
    },
    { root, rootMargin: "200px" },
  );
  return watcher;
}
