"""What peers of several parts share: NumPy as one types it, and OpenImageIO between its own buffers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import OpenImageIO as oiio
from comparing import Call, Images, Peer, Prepare, Values

from lichen.memory import Array


def typed(name: str, work: Callable[[Array], Any], same: bool = True) -> Peer:
    """`work` receives the pixels, and runs on one thread whatever it is given."""
    return Peer(name, lambda inputs, values: lambda: work(inputs["image"].pixels), same, alone=True)


def by_oiio(work: Callable[[Any, Any, Values], bool]) -> Prepare:
    """`work` receives the result's buffer and the source's, and is all that is timed: what reads the buffer out, which
    OpenImageIO has no view of, happens when somebody asks for the array."""

    def prepare(inputs: Images, values: Values) -> Call:
        x = inputs["image"].pixels
        height, width, channels = x.shape
        before, after = oiio.ImageBuf(x), oiio.ImageBuf(oiio.ImageSpec(width, height, channels, oiio.FLOAT))

        def run() -> Late:
            if not work(after, before, values):
                raise RuntimeError(after.geterror())
            return Late(after)

        return run

    return prepare


class Late:
    """The pixels of a buffer, read when they are asked for."""

    def __init__(self, buffer: Any) -> None:
        self._buffer = buffer

    def __array__(self, dtype: Any = None, copy: Any = None) -> Array:
        return np.asarray(self._buffer.get_pixels(oiio.FLOAT), dtype)
