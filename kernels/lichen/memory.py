"""Memory that devices use without a copy.

Arrays are aligned for the widest vector load, so a CPU device maps them as they are. Large ones are taken from the
system by `mmap` and kept for reuse when their last view dies: fresh pages cost a fault each, which on a large
image is as much time as a fast kernel takes.
"""

from __future__ import annotations

import mmap
import threading
import weakref
from collections import OrderedDict
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

ALIGNMENT = 128
"""Bytes; what the widest load of a kernel wants."""
KEPT = 512 << 20
"""Bytes kept for reuse at most."""
POOLED = 1 << 20
"""Bytes; smaller arrays are not worth keeping."""


class _Pool:
    """Blocks of memory whose arrays have died, oldest dropped first."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._held = 0
        self._blocks: OrderedDict[int, list[mmap.mmap]] = OrderedDict()
        self._lock = threading.RLock()  # a finaliser may run inside any allocation, this module's own too

    def take(self, size: int) -> mmap.mmap:
        with self._lock:
            blocks = self._blocks.get(size)
            if blocks:
                self._held -= size
                block = blocks.pop()
                if not blocks:
                    del self._blocks[size]
                return block
        return mmap.mmap(-1, size)

    def give(self, block: mmap.mmap, size: int) -> None:
        with self._lock:
            self._blocks.setdefault(size, []).append(block)
            self._blocks.move_to_end(size)
            self._held += size
            while self._held > self._capacity:
                oldest, blocks = next(iter(self._blocks.items()))
                blocks.pop()
                self._held -= oldest
                if not blocks:
                    del self._blocks[oldest]


_pool = _Pool(KEPT)


def aligned_empty(shape: tuple[int, ...], dtype: npt.DTypeLike = np.float32) -> Array:
    """An uninitialised C-ordered array of `shape`, aligned for the widest vector load (large ones to a page)."""
    kind = np.dtype(dtype)
    count = int(np.prod(shape, dtype=np.int64))
    size = -(-max(count * kind.itemsize, 1) // mmap.PAGESIZE) * mmap.PAGESIZE
    if size < POOLED:
        spare = np.empty(count * kind.itemsize + ALIGNMENT, dtype=np.uint8)
        skip = -spare.ctypes.data % ALIGNMENT
        return spare[skip : skip + count * kind.itemsize].view(kind).reshape(shape)
    block = _pool.take(size)
    root = np.frombuffer(block, dtype=np.uint8)
    # Every view keeps `root` alive, so the block returns when the last of them is gone.
    weakref.finalize(root, _pool.give, block, size).atexit = False
    return root[: count * kind.itemsize].view(kind).reshape(shape)


def aligned(array: Array, dtype: npt.DTypeLike = np.float32) -> Array:
    """`array` as a C-ordered, aligned array of `dtype`; itself where it already is one."""
    kind = np.dtype(dtype)
    if array.dtype == kind and array.flags.c_contiguous and array.ctypes.data % ALIGNMENT == 0:
        return array
    copy = aligned_empty(array.shape, kind)
    copy[...] = array
    return copy
