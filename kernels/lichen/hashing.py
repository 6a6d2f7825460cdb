"""Random numbers that depend on nothing but where they are asked for: the NumPy twin of `hash.clh`, bit for bit.

PCG (O'Neill 2014) used as hash functions, after M. Jarzynski and M. Olano, "Hash Functions for GPU Rendering", JCGT
9(3), 2020. All arithmetic is modulo 2^32 on uint32 arrays of any shape; arguments broadcast.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Words: TypeAlias = npt.NDArray[np.uint32]

_MULTIPLIER = np.uint32(1664525)
_INCREMENT = np.uint32(1013904223)
_HALF = np.uint32(16)


def _words(value: npt.ArrayLike) -> Words:
    """Integers as uint32, negative ones by two's complement; never 0-d, since scalars warn of overflow."""
    return np.atleast_1d(np.asarray(value)).astype(np.uint32, casting="unsafe")


def pcg(v: npt.ArrayLike) -> Words:
    """One number to one."""
    state = _words(v) * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    mixed: Words = (word >> np.uint32(22)) ^ word
    return mixed


def pcg2d(x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Words, Words]:
    """Two numbers to two, each a hash of both."""
    a = _words(x) * _MULTIPLIER + _INCREMENT
    b = _words(y) * _MULTIPLIER + _INCREMENT
    a = a + b * _MULTIPLIER
    b = b + a * _MULTIPLIER
    a = a ^ (a >> _HALF)
    b = b ^ (b >> _HALF)
    a = a + b * _MULTIPLIER
    b = b + a * _MULTIPLIER
    return a ^ (a >> _HALF), b ^ (b >> _HALF)


def pcg3d(x: npt.ArrayLike, y: npt.ArrayLike, z: npt.ArrayLike) -> tuple[Words, Words, Words]:
    """Three numbers to three, each a hash of all."""
    a = _words(x) * _MULTIPLIER + _INCREMENT
    b = _words(y) * _MULTIPLIER + _INCREMENT
    c = _words(z) * _MULTIPLIER + _INCREMENT
    a = a + b * c
    b = b + c * a
    c = c + a * b
    a, b, c = a ^ (a >> _HALF), b ^ (b >> _HALF), c ^ (c >> _HALF)
    a = a + b * c
    b = b + c * a
    return a, b, c + a * b


def keyed(x: npt.ArrayLike, a: npt.ArrayLike, b: npt.ArrayLike) -> Words:
    """One number to one under a key of two words: `pcg` started at a place of the key's own, and turned by it midway.

    For lattices: the words of a row under its key are unlike those of every other row, shifted or not, and all that is
    done for each point is one `pcg`."""
    state = (_words(x) + _words(a)) * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state ^ _words(b)) * np.uint32(277803737)
    mixed: Words = (word >> np.uint32(22)) ^ word
    return mixed


def unit(v: Words) -> npt.NDArray[np.float32]:
    """The upper 24 bits as float32 in [0, 1), exactly."""
    return (v >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)
