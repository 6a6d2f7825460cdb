"""Octaves: the frequency, place and amplitude of each, and which of them a picture can show.

Octave k has frequency lacunarity^k / cell along each axis, its own hash key, and, from the second on, a shift of its
own, so that octaves do not share the zeros of their lattices (McReynolds and Blythe, section 5.13.4). In a picture that
repeats, frequencies are rounded to a whole number of cells, so lacunarity need not be an integer.

A noise whose power ends at `band` cycles per cell cannot be sampled at more than half a cycle per px. With `antialias`
an octave counts in full while twice its band can be shown, fades with the logarithm of its frequency, and from the
limit on is replaced by its mean, as in Pharr, Jakob and Humphreys, Physically Based Rendering, section 10.6. Nothing of
that is an error: it is the definition, and `Cut` says how much it leaves out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.hashing import Words, pcg2d, pcg3d, unit
from lichen.operations.noise.coordinates import FARTHEST, Axis, pixel_axis, point_axis
from lichen.operations.noise.parameters import Fractal, LatticeParameters

Key = tuple[int, int]
MOST_CELLS = 2**22
"""Cells across a picture that repeats, so that their numbers are exact in float32."""


def chained(key: tuple[Words, Words] | Key, coordinate: object) -> tuple[Words, Words]:
    """The key of a part of the lattice: of a row, from that of its slice. `hash_pcg2d` gives the same bits."""
    a, b = key
    cells = np.atleast_1d(np.asarray(coordinate)).astype(np.int64).astype(np.uint32, casting="unsafe")
    return pcg2d(cells + np.asarray(a, np.uint32), np.asarray(b, np.uint32))


def smooth(t: float) -> float:
    """0 below 0, 1 above 1, a smooth step between."""
    t = min(max(t, 0.0), 1.0)
    return t * t * (3 - 2 * t)


@dataclass(frozen=True, slots=True)
class Lattice:
    """What octaves must know of a basis: its `band`, and how its rows lie."""

    band: float
    """cycles per cell below which 95 % of the power lies, as measured"""
    rows_per_cell: float = 1.0
    """rows of lattice points in a cell's height"""
    rows_multiple: int = 1
    """a period along y holds a multiple of so many rows"""
    side: int = 0
    """cells after which the lattice comes again by itself, about: a period of more holds whole tables of an even
    number of cells; 0: never"""

    def fitted(self, cells: float, multiple: int = 1) -> int:
        """The period nearest to so many cells, or rows."""
        tables = max(1, round(cells / self.side)) if self.side else 1
        each = 2 * tables if self.side else multiple
        return each * max(1, round(cells / each))


@dataclass(frozen=True, slots=True)
class Octave:
    """One octave of one picture."""

    index: int
    amplitude: float
    """its share of all amplitudes"""
    kept: float
    """how much of it pixels can show: 1, less while it fades, 0 beyond"""
    frequency: tuple[float, float]
    """cells, or rows, per px"""
    period: tuple[int, int, int]
    """cells along x, rows along y, cells along z; 0: never"""
    depth: float
    """cells of z per cell of the first octave"""
    shift: tuple[float, float, float, float]

    def axes(self, p: LatticeParameters) -> tuple[Axis, ...]:
        """x of every column, y of every row, z and w."""
        scale = p.lacunarity**self.index
        all_four = (
            pixel_axis(p.x, p.width, self.frequency[0], self.shift[0], self.period[0]),
            pixel_axis(p.y, p.height, self.frequency[1], self.shift[1], self.period[1]),
            point_axis(p.z, self.depth, self.shift[2], self.period[2]),
            point_axis(p.w, scale, self.shift[3]),
        )
        return all_four[: p.dimensions]

    def key(self, p: LatticeParameters, stream: int) -> Key:
        """Of this octave's whole lattice; `stream` 0 is the noise, 1 and 2 are what moves its places."""
        a, b = pcg2d(p.seed, 64 * stream + self.index)
        return int(a[0]), int(b[0])

    def farthest(self, p: LatticeParameters) -> float:
        """Cells from the origin, about."""
        scale = p.lacunarity**self.index
        ends = max(abs(p.x), abs(p.x + p.width), 1.0) * self.frequency[0]
        down = max(abs(p.y), abs(p.y + p.height), 1.0) * self.frequency[1]
        return max(ends, down, abs(p.z) * self.depth, abs(p.w) * scale)


@lru_cache(maxsize=64)
def octaves(p: LatticeParameters, lattice: Lattice) -> tuple[Octave, ...]:
    """All octaves that the definition has, those that cannot be shown too."""
    raw = [float(p.gain**k) for k in range(p.asked)]
    total = math.fsum(raw)
    found = []
    for k, amplitude in enumerate(raw):
        scale = p.lacunarity**k
        across, down = (scale / side for side in p.cells)
        down *= lattice.rows_per_cell
        period_x = period_y = 0
        if p.tile:
            period_x = lattice.fitted(p.width * across)
            period_y = lattice.fitted(p.height * down, lattice.rows_multiple)
            across, down = period_x / p.width, period_y / p.height
        period_z = lattice.fitted(p.loop * scale) if p.loop else 0
        fastest = max(across, down / lattice.rows_per_cell) * lattice.band
        kept = smooth(-1 - math.log2(fastest)) if p.antialias else 1.0
        shift = (0.0,) * 4 if k == 0 else _shift(p.seed, k)
        depth = period_z / p.loop if p.loop else scale
        found.append(Octave(k, amplitude / total, kept, (across, down), (period_x, period_y, period_z), depth, shift))
    return tuple(found)


@lru_cache(maxsize=1024)
def _shift(seed: int, octave: int) -> tuple[float, float, float, float]:
    """Of an octave's lattice, in cells: multiples of 2^-24."""
    a, b, c = pcg3d(seed, octave, 0x5EED)
    d = pcg3d(seed, octave, 0x5EEE)[0]
    return (float(unit(a)[0]), float(unit(b)[0]), float(unit(c)[0]), float(unit(d)[0]))


@dataclass(frozen=True, slots=True)
class Cut:
    """The octaves of a picture, divided into those that are computed and those that their mean stands for."""

    asked: tuple[Octave, ...]
    computed: tuple[Octave, ...]

    @property
    def left(self) -> tuple[Octave, ...]:
        return self.asked[len(self.computed) :]

    @property
    def beyond(self) -> int:
        """How many no pixel can show."""
        return sum(octave.kept == 0 for octave in self.asked)


@lru_cache(maxsize=64)
def visible(p: LatticeParameters, lattice: Lattice) -> Cut:
    """All octaves that can be shown: what the definition sums."""
    asked = octaves(p, lattice)
    return Cut(asked, tuple(octave for octave in asked if octave.kept > 0))


@lru_cache(maxsize=64)
def cut(p: LatticeParameters, lattice: Lattice, tail: float) -> tuple[Cut, float]:
    """As few octaves as leave out no more than `tail` of the range, and how much they leave out: the range is 2."""
    shown = visible(p, lattice)
    computed = list(shown.computed)
    lost = 0.0
    following = 2 * sum(octave.amplitude for octave in shown.left) if p.fractal is Fractal.RIDGED else 0.0
    while computed and lost + following + _worth(p, computed[-1]) <= 2 * tail:
        lost += following + _worth(p, computed.pop())
        following = 0.0
    return Cut(shown.asked, tuple(computed)), lost


def _worth(p: LatticeParameters, octave: Octave) -> float:
    """The largest change of the sum when the octave's mean stands for it.

    n and its mean differ by 2 at most, |n| and its mean by 1. A ridge also weighs what comes after it, by a weight that
    may be any, so it counts in full however faded it is, and so do those after it that their mean stands for.
    """
    if p.fractal is Fractal.RIDGED:
        return 2 * octave.amplitude
    return (1 if p.fractal is Fractal.TURBULENCE else 2) * octave.amplitude * octave.kept


def too_far(p: LatticeParameters, shown: Sequence[Octave]) -> Octave | None:
    """The first octave whose coordinates cannot be told apart any more, or whose cells cannot be numbered."""
    for octave in shown:
        if octave.farthest(p) >= FARTHEST or max(octave.period) > MOST_CELLS:
            return octave
    return None
