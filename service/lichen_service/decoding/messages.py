"""What a service and its decoders say to each other, over a socket of packets.

    to the decoder      {"seconds", "select"}     with the encoded bytes as a descriptor of shared memory
    from the decoder    {"shape", "dtype"}        with the samples, as they are stored, as another
                        {"error", "detail", "flaws", "limit", "actual"}

Everything is JSON and raw memory, never a pickle: a decoder that was taken over can say something wrong, but it cannot
make the service run anything. Shapes and types are checked against the size of the memory before it is looked at.
"""

from __future__ import annotations

import json
import math
import mmap
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen import errors
from lichen.errors import Flaw, LichenError, UnreadableImage
from lichen.memory import Array

LARGEST = 1 << 16
"""bytes of one message"""
_ERRORS: Mapping[str, type[LichenError]] = {
    each.code: each
    for each in (errors.TooLarge, errors.UnsupportedFormat, errors.UnreadableImage, errors.InvalidRequest)
}


def shared(data: memoryview, name: str) -> int:
    """A descriptor of memory that holds a copy of the bytes."""
    descriptor = room(len(data), name)
    try:
        while len(data):
            data = data[os.write(descriptor, data) :]
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def room(count: int, name: str) -> int:
    """A descriptor of so many bytes of memory."""
    descriptor = os.memfd_create(name, os.MFD_CLOEXEC)
    try:
        os.ftruncate(descriptor, count)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def mapped(descriptor: int) -> mmap.mmap:
    """The memory behind a descriptor, all of it at once: page by page would cost more than the copy."""
    return mmap.mmap(descriptor, os.fstat(descriptor).st_size, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE)


def said_of(samples: Array) -> dict[str, Any]:
    """Samples without their memory."""
    return {"shape": samples.shape, "dtype": samples.dtype.str}


def samples_of(said: Mapping[str, Any], memory: mmap.mmap) -> Array:
    """The samples that a decoder told of. Raises `UnreadableImage` where they do not agree with their memory."""
    shape = tuple(int(each) for each in said["shape"])
    dtype = np.dtype(str(said["dtype"]))
    if dtype.kind not in "uf" or len(shape) != 3 or min(shape) < 1 or math.prod(shape) * dtype.itemsize > len(memory):
        raise UnreadableImage("The decoder gave something else than it promised.")
    return np.frombuffer(memory, dtype, math.prod(shape)).reshape(shape)


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
