"""A process that does items one after the other with a warm engine: `python -m lichen_batch.hand`.

It reads an item as a line of JSON on standard input and answers with its outcome as a line on standard output; first of
all it says that it is ready. It ends at once, in the middle of an item too, when whoever started it has gone: its
standard input has ended then. What libraries print goes to standard error.
"""

from __future__ import annotations

import faulthandler
import json
import os
import queue
import sys
import threading
from contextlib import nullcontext
from typing import Any, BinaryIO

from lichen_batch.item import Item


def main() -> int:
    faulthandler.enable()
    said = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, lines), daemon=True).start()
    options = json.loads(lines.get())

    from lichen.accuracy.times import held
    from lichen_batch.work import perform
    from lichen_client import Client

    client = Client(local=True, timeout=1e9, retries=0, memory=options.get("memory"))
    known = options.get("times")
    with nullcontext() if known is None else held(known):
        _warm_up(client)
        _say(said, b'{"ready":true}')
        while True:
            item = Item.from_json(json.loads(lines.get()))
            _say(said, perform(client, item, options["token"]).to_line())


def _warm_up(client: Any) -> None:
    """Finds the device, and sends one tiny image along the whole road."""
    import numpy as np

    client.run("gaussian", np.zeros((8, 8, 3), np.float32), sigma=1.0, format="png")


def _listen(source: BinaryIO, lines: queue.SimpleQueue[bytes]) -> None:
    for line in source:
        lines.put(line)
    os._exit(0)


def _say(to: BinaryIO, line: bytes) -> None:
    view = memoryview(line + b"\n")
    while len(view):
        view = view[to.write(view) :]


if __name__ == "__main__":
    sys.exit(main())
