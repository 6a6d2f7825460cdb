// One request at a time for a picture that follows a hand. While a slider is dragged, a cheap version is asked for: one
// that is on its way is let finish, so that the picture moves, and only the newest of those that wait is sent. What is
// asked on release stops whatever is on its way, and is stopped by anything newer.

export class Runner {
  #going = null;
  #next = null;

  // `send(order, signal)` makes the request; `settled(result, order)` and `failed(failure, order)` hear how it went.
  constructor({ send, settled, failed, busy }) {
    Object.assign(this, { send, settled, failed, busy });
  }

  ask(order) {
    if (!this.#going) return this.#start(order);
    this.#next = order;
    if (!order.preview || !this.#going.order.preview) this.#going.controller.abort();
    return undefined;
  }

  stop() {
    this.#next = null;
    this.#going?.controller.abort();
  }

  async #start(order) {
    const controller = new AbortController();
    const going = (this.#going = { order, controller });
    this.busy?.(true, order);
    try {
      const result = await this.send(order, controller.signal);
      if (!controller.signal.aborted) await this.settled(result, order);
    } catch (failure) {
      if (!controller.signal.aborted) this.failed(failure, order);
    }
    if (this.#going === going) this.#going = null;
    const next = this.#next;
    this.#next = null;
    if (next) this.#start(next);
    else this.busy?.(false, order);
  }
}
