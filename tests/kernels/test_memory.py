"""Memory for devices: where it starts, who shares it, and how much of it is kept."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from lichen import memory
from lichen.memory import ALIGNMENT, HUGE, aligned, aligned_empty


@pytest.mark.parametrize("shape", [(1,), (3, 5, 3), (700, 701), (1024, 1024, 3)])
def test_arrays_start_where_the_widest_load_and_a_huge_page_want_it(shape: tuple[int, ...]) -> None:
    made = aligned_empty(shape)
    assert made.shape == shape
    assert made.dtype == np.float32
    assert made.ctypes.data % (HUGE if made.nbytes >= HUGE else ALIGNMENT) == 0
    made[...] = 3
    assert (made == 3).all()
    assert aligned(made) is made


def test_what_is_not_aligned_is_copied() -> None:
    odd = np.arange(1, 2_000_000, dtype=np.float32)[1:]
    copy = aligned(odd)
    assert copy is not odd
    assert np.array_equal(copy, odd)
    assert copy.ctypes.data % HUGE == 0


def test_large_memory_is_used_again_once_its_last_view_is_gone() -> None:
    shape = (1031, 1033)
    made = aligned_empty(shape)
    at, view = made.ctypes.data, made[7:]
    del made
    gc.collect()
    other = aligned_empty(shape)
    assert other.ctypes.data != at, "a view of it is still alive"
    del view
    gc.collect()
    assert aligned_empty(shape).ctypes.data == at


def test_no_more_is_kept_than_said() -> None:
    pool = memory._Pool(10 << 20)
    blocks = [pool.take(size << 20) for size in (3, 3, 4, 5)]
    for block in blocks:
        pool.give(block)
    assert pool._held <= 10 << 20
    assert pool.take(5 << 20) is blocks[-1]
    assert pool.take(3 << 20) is not blocks[0], "the oldest goes first"


def test_what_is_kept_shrinks_when_less_may_be() -> None:
    pool = memory._Pool(10 << 20)
    blocks = [pool.take(4 << 20) for _ in range(2)]
    for block in blocks:
        pool.give(block)
    pool.keep(5 << 20)
    assert pool._held == 4 << 20
    assert pool.take(4 << 20) is blocks[0]
