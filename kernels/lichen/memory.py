"""Memory that devices use without a copy.

Arrays are aligned for the widest vector load, so a CPU device maps them as they are. Large ones are taken from the
system by `mmap`, in huge pages where it grants them, and kept for reuse when their last view dies: fresh pages cost a
fault each, which on a large image is as much time as a fast kernel takes, and small ones a walk through the page table
for every 4 kB. Decoding sRGB at 2048 x 2048 takes 0.7 of the time in huge pages, and fresh memory an eighth.
"""

from __future__ import annotations

import math
import mmap
import threading
import weakref
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

ALIGNMENT = 128
"""Bytes; what the widest load of a kernel wants."""
KEPT = 512 << 20
"""Bytes kept for reuse at most, where nobody says otherwise (`keep`)."""
POOLED = 1 << 20
"""Bytes; smaller arrays are not worth keeping."""
HUGE = 2 << 20
"""Bytes of a huge page, at multiples of which they start."""


@dataclass(frozen=True, slots=True)
class _Block:
    """Memory of the system, of which the array takes `size` bytes from `skip` on."""

    memory: mmap.mmap
    size: int
    skip: int

    @classmethod
    def new(cls, size: int) -> _Block:
        """A fresh one; of a huge page or more it starts where one does."""
        if size < HUGE or not hasattr(mmap, "MADV_HUGEPAGE"):
            return cls(mmap.mmap(-1, size), size, 0)
        memory = mmap.mmap(-1, size + HUGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        with suppress(OSError):  # a kernel without them
            memory.madvise(mmap.MADV_HUGEPAGE)
        return cls(memory, size, -np.frombuffer(memory, np.uint8, 1).ctypes.data % HUGE)


class _Pool:
    """Blocks of memory whose arrays have died, oldest dropped first."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._held = 0
        self._blocks: OrderedDict[int, list[_Block]] = OrderedDict()
        self._lock = threading.RLock()  # a finaliser may run inside any allocation, this module's own too

    def take(self, size: int) -> _Block:
        with self._lock:
            blocks = self._blocks.get(size)
            if blocks:
                self._held -= size
                block = blocks.pop()
                if not blocks:
                    del self._blocks[size]
                return block
        return _Block.new(size)

    def give(self, block: _Block) -> None:
        with self._lock:
            self._blocks.setdefault(block.size, []).append(block)
            self._blocks.move_to_end(block.size)
            self._held += block.size
            self._shorten()

    def keep(self, capacity: int) -> None:
        with self._lock:
            self._capacity = capacity
            self._shorten()

    def _shorten(self) -> None:
        while self._held > self._capacity:
            oldest, blocks = next(iter(self._blocks.items()))
            blocks.pop()
            self._held -= oldest
            if not blocks:
                del self._blocks[oldest]


_pool = _Pool(KEPT)


class _Lent(weakref.ref[Array]):
    """An array that is in use, and the block that it lies in."""

    __slots__ = ("block",)
    block: _Block


_lent: dict[int, _Lent] = {}
"""All of them: a reference that is dropped tells nobody. `weakref.finalize` would do the same in twice the time."""


def _returned(lent: weakref.ref[Array], pool: _Pool = _pool, alive: dict[int, _Lent] = _lent) -> None:
    pool.give(alive.pop(id(lent)).block)


def keep(count: int) -> None:
    """Keep so many bytes for reuse at most from now on, and let go at once of what is more."""
    _pool.keep(count)


def aligned_empty(shape: tuple[int, ...], dtype: npt.DTypeLike = np.float32) -> Array:
    """An uninitialised C-ordered array of `shape`, aligned for the widest vector load (large ones to a page)."""
    kind = np.dtype(dtype)
    count = math.prod(shape)
    size = -(-max(count * kind.itemsize, 1) // mmap.PAGESIZE) * mmap.PAGESIZE
    if size < POOLED:
        spare = np.empty(count * kind.itemsize + ALIGNMENT, dtype=np.uint8)
        skip = -spare.ctypes.data % ALIGNMENT
        return spare[skip : skip + count * kind.itemsize].view(kind).reshape(shape)
    block = _pool.take(size)
    made: Array = np.ndarray(shape, kind, block.memory, block.skip)
    # Every view keeps `made` alive, so the block returns when the last of them is gone.
    lent = _Lent(made, _returned)
    lent.block = block
    _lent[id(lent)] = lent
    return made


def aligned(array: Array, dtype: npt.DTypeLike = np.float32) -> Array:
    """`array` as a C-ordered, aligned array of `dtype`; itself where it already is one."""
    kind = np.dtype(dtype)
    if array.dtype == kind and array.flags.c_contiguous and array.ctypes.data % ALIGNMENT == 0:
        return array
    copy = aligned_empty(array.shape, kind)
    copy[...] = array
    return copy


def room(count: int) -> memoryview:
    """Uninitialised memory for a file of so many bytes, kept for reuse where it is large. It is taken in whole MiB
    then, since hardly two files are of one size."""
    if count < POOLED:
        return memoryview(bytearray(count))
    return aligned_empty((-(-count // POOLED) * POOLED,), np.uint8).data[:count]


def joined(parts: Sequence[bytes | memoryview]) -> bytes | memoryview:
    """The bytes of all, one behind the other; many of them in `room`, which takes a fifth of the time for 144 MB."""
    views = [memoryview(part).cast("B") for part in parts]
    count = sum([len(view) for view in views])
    if count < POOLED:
        return b"".join(views)
    whole, at = room(count), 0
    for view in views:
        whole[at : at + len(view)] = view
        at += len(view)
    return whole
