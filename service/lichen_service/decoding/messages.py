"""What a service and its decoders say to each other, over a socket of packets.

    to the decoder      {"seconds", "select", "count"}    with the encoded bytes as a descriptor of shared memory
    from the decoder    {"shape", "dtype"}                with the samples, as they are stored, as another
                        {"error", "detail", "flaws", "limit", "actual"}

Each side keeps the memory that it writes for the next image: who has asked looks at samples only until he asks again.

Everything is JSON and raw memory, never a pickle: a decoder that was taken over can say something wrong, but it cannot
make the service run anything. Shapes and types are checked against the size of the memory before it is looked at.
"""

from __future__ import annotations

import json
import math
import mmap
import os
import weakref
from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen import errors
from lichen.errors import Flaw, LichenError, UnreadableImage
from lichen.memory import Array

LARGEST = 1 << 16
"""bytes of one message"""
KEPT = 64 << 20
"""bytes of shared memory that are kept on each side"""
_ERRORS: Mapping[str, type[LichenError]] = {
    each.code: each
    for each in (errors.TooLarge, errors.UnsupportedFormat, errors.UnreadableImage, errors.InvalidRequest)
}


class Room:
    """Shared memory that one side writes and the other reads.

    As much as `KEPT` is kept from one image to the next: the first touch of a page is what costs most (72 MB take 13 ms
    to write, and 90 ms where all pages are new).
    """

    def __init__(self, name: str) -> None:
        self.descriptor = os.memfd_create(name, os.MFD_CLOEXEC)
        weakref.finalize(self, os.close, self.descriptor).atexit = False

    def make(self, count: int) -> None:
        """Room for so many bytes."""
        if os.fstat(self.descriptor).st_size < count:
            os.ftruncate(self.descriptor, count)

    def write(self, data: memoryview) -> None:
        """From the beginning; what was written before may remain behind it."""
        self.make(len(data))
        at = 0
        while at < len(data):
            at += os.pwrite(self.descriptor, data[at:], at)

    def clear(self) -> None:
        """Nobody looks at it any more."""
        if os.fstat(self.descriptor).st_size > KEPT:
            os.ftruncate(self.descriptor, KEPT)


def mapped(descriptor: int, count: int) -> mmap.mmap:
    """The first bytes of the memory behind a descriptor, all of them at once: page by page would cost more than the
    copy. Raises `UnreadableImage` where there are fewer."""
    if os.fstat(descriptor).st_size < count:
        raise UnreadableImage("The decoder gave something else than it promised.")
    return mmap.mmap(descriptor, count, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE)


class Window:
    """Memory that comes again and again, mapped once as long as it is the same memory and as much of it: to map 36 MB
    takes 5 ms. Of more than `KEPT` nothing is kept."""

    def __init__(self) -> None:
        self._of = (0, 0, 0)
        self._kept: mmap.mmap | None = None

    def mapped(self, descriptor: int, count: int) -> mmap.mmap:
        """As `mapped`."""
        found = os.fstat(descriptor)
        memory = (found.st_dev, found.st_ino, count)
        if self._kept is None or self._of != memory or found.st_size < count:
            self.close()
            made = mapped(descriptor, count)
            if count > KEPT:
                return made
            self._of, self._kept = memory, made
        return self._kept

    def close(self) -> None:
        """Keep nothing; who looks through it still does."""
        self._kept = None


def said_of(samples: Array) -> dict[str, Any]:
    """Samples without their memory."""
    return {"shape": samples.shape, "dtype": samples.dtype.str}


def samples_of(said: Mapping[str, Any], descriptor: int, window: Window) -> Array:
    """The samples that a decoder told of. Raises `UnreadableImage` where they do not agree with their memory."""
    shape = tuple(int(each) for each in said["shape"])
    dtype = np.dtype(str(said["dtype"]))
    if dtype.kind not in "uf" or len(shape) != 3 or min(shape) < 1:
        raise UnreadableImage("The decoder gave something else than it promised.")
    return np.frombuffer(window.mapped(descriptor, math.prod(shape) * dtype.itemsize), dtype).reshape(shape)


def said_of_error(error: LichenError) -> dict[str, Any]:
    return {
        "error": error.code,
        "detail": error.detail,
        "flaws": [(flaw.pointer, flaw.detail) for flaw in error.flaws],
        "limit": error.limit,
        "actual": error.actual,
    }


def error_of(said: Mapping[str, Any]) -> LichenError:
    kind = _ERRORS.get(said["error"], UnreadableImage)
    flaws = [Flaw(str(pointer), str(detail)) for pointer, detail in said["flaws"]]
    return kind(str(said["detail"]), flaws, limit=said["limit"], actual=said["actual"])


def dumps(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value).encode()
