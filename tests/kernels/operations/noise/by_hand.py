"""Noises at one place, from their definitions: plain integers, exact fractions, loops over all that could matter.

Nothing here comes from the library. Hashes are those of O'Neill and of Jarzynski and Olano on Python's integers; places
are fractions of integers, so no coordinate is ever rounded; simplex, Worley and spot noise try every point near a
place."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import reduce
from itertools import product
from typing import Any

import numpy as np

MASK = 0xFFFFFFFF
Place = tuple[Fraction, ...]
Key = tuple[int, int]


def pcg(v: int) -> int:
    state = (v * 747796405 + 2891336453) & MASK
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & MASK
    return (word >> 22) ^ word


def pcg2d(x: int, y: int) -> Key:
    a, b = ((v & MASK) * 1664525 + 1013904223 & MASK for v in (x, y))
    a = a + b * 1664525 & MASK
    b = b + a * 1664525 & MASK
    a, b = a ^ a >> 16, b ^ b >> 16
    a = a + b * 1664525 & MASK
    b = b + a * 1664525 & MASK
    return a ^ a >> 16, b ^ b >> 16


def pcg3d(x: int, y: int, z: int) -> tuple[int, int, int]:
    a, b, c = ((v & MASK) * 1664525 + 1013904223 & MASK for v in (x, y, z))
    a = a + b * c & MASK
    b = b + c * a & MASK
    c = c + a * b & MASK
    a, b, c = a ^ a >> 16, b ^ b >> 16, c ^ c >> 16
    a = a + b * c & MASK
    b = b + c * a & MASK
    return a, b, c + a * b & MASK


def point(key: Key, cell: tuple[int, ...]) -> int:
    """The hash of a lattice point: w, z and y chained, then x under their key."""
    a, b = key
    for coordinate in reversed(cell[1:]):
        a, b = pcg2d(coordinate + a, b)
    state = ((cell[0] + a) * 747796405 + 2891336453) & MASK
    word = (((state >> ((state >> 28) + 4)) ^ state ^ b) * 277803737) & MASK
    return (word >> 22) ^ word


def gradient(h: int, dimensions: int) -> list[float]:
    signs = [-1 if h >> bit & 1 else 1 for bit in range(4)]
    if dimensions == 2:
        part = math.tan(math.pi / 8)
        x, y = (part, 1) if h >> 2 & 1 else (1, part)
        return [signs[0] * x, signs[1] * y]
    none = (h >> 16) * 3 >> 16 if dimensions == 3 else h >> 30
    return [0 if axis == none else signs[axis] for axis in range(dimensions)]


def fade(t: float, name: str) -> float:
    return t**3 * (t * (6 * t - 15) + 10) if name == "quintic" else t * t * (3 - 2 * t)


def cornered(at: Place, says: Callable[[tuple[int, ...], list[float]], float], name: str) -> float:
    cell = [math.floor(c) for c in at]
    t = [float(c - n) for c, n in zip(at, cell, strict=True)]
    total = 0.0
    for corner in product((0, 1), repeat=len(at)):
        weight = math.prod(fade(f, name) if c else 1 - fade(f, name) for c, f in zip(corner, t, strict=True))
        away = [f - c for f, c in zip(t, corner, strict=True)]
        total += weight * says(tuple(n + c for n, c in zip(cell, corner, strict=True)), away)
    return total


def value(at: Place, key: Key, p: Any) -> float:
    return cornered(at, lambda cell, away: (point(key, cell) >> 8) / 2**23 - 1, p.fade)


def perlin(at: Place, key: Key, p: Any) -> float:
    d = len(at)
    length = {2: 1 / math.cos(math.pi / 8), 3: math.sqrt(2), 4: math.sqrt(3)}[d]

    def says(cell: tuple[int, ...], away: list[float]) -> float:
        return sum(g * c for g, c in zip(gradient(point(key, cell), d), away, strict=True))

    return cornered(at, says, p.fade) * 2 / (math.sqrt(d) * length)


def simplex(at: Place, key: Key, p: Any) -> float:
    d = len(at)
    reach, inverse = {2: (0.75, 16.0), 3: (0.5, 107.4), 4: (0.5, 108.5)}[d]
    length = {2: 1 / math.cos(math.pi / 8), 3: math.sqrt(2), 4: math.sqrt(3)}[d]
    total = 0.0
    for points, own in _simplex_points(at, key):
        for cell, away in points:
            rest = reach - sum(c * c for c in away)
            if rest > 0:
                total += rest**4 * sum(g * c for g, c in zip(gradient(point(own, cell), d), away, strict=True))
    return total * inverse / length


def _simplex_points(at: Place, key: Key) -> Iterator[tuple[list[tuple[tuple[int, ...], list[float]]], Key]]:
    around = [range(math.floor(c) - 2, math.floor(c) + 3) for c in at]
    if len(at) == 2:
        x, row = at
        height = math.sqrt(3) / 2
        yield [((i, r), [float(x - i - Fraction(r % 2, 2)), float(row - r) * height]) for i, r in product(*around)], key
        return
    for half, own in ((Fraction(0), key), (Fraction(1, 2), (key[0] ^ 0xB5297A4D, key[1]))):
        yield [(cell, [float(c - n - half) for c, n in zip(at, cell, strict=True)]) for cell in product(*around)], own


def worley(at: Place, key: Key, p: Any) -> float:
    d = len(at)
    found = []
    reach = 4 if d == 2 else 3
    for cell in product(*(range(math.floor(c) - reach, math.floor(c) + reach + 1) for c in at)):
        h = point(key, cell)
        halves = [h & 0xFFFF, h >> 16, pcg(h) & 0xFFFF, pcg(h) >> 16][:d]
        away = [
            float(c - n) - (0.5 + p.jitter * ((half + 0.5) / 65536 - 0.5))
            for c, n, half in zip(at, cell, halves, strict=True)
        ]
        sizes = [abs(c) for c in away]
        found.append({"euclidean": math.hypot(*sizes), "manhattan": sum(sizes), "chebyshev": max(sizes)}[p.metric])
    first, second = sorted(found)[:2]
    far = {"f1": first, "f2": second, "f2-f1": second - first}[p.feature]
    return 2 * far / _farthest(p, d) - 1


def _farthest(p: Any, d: int) -> float:
    def length(sizes: list[float]) -> float:
        return {"euclidean": math.hypot(*sizes), "manhattan": sum(sizes), "chebyshev": max(sizes)}[p.metric]

    own = length([0.5 + p.jitter / 2] * d)
    return own if p.feature == "f1" else max(own, length([1 + p.jitter / 2] + [p.jitter / 2] * (d - 1)))


def sparse(at: Place, key: Key, p: Any) -> float:
    """Spot and Gabor noise."""
    d = len(at)
    stretch, waves = getattr(p, "stretch", 1.0), getattr(p, "waves", 0.0)
    turn = math.radians(p.angle)
    total = 0.0
    for cell in product(*(range(math.floor(c) - 2, math.floor(c) + 3) for c in at)):
        h = point(key, cell)
        for m in range(p.impulses):
            g = pcg((h + m * 0x9E3779B9) & MASK)
            more = pcg(g)
            last = pcg(more)
            halves = [g & 0xFFFF, g >> 16, last & 0xFFFF, last >> 16][:d]
            away = [float(c - n) - (half + 0.5) / 65536 for c, n, half in zip(at, cell, halves, strict=True)]
            along = away[0] * math.cos(turn) + away[1] * math.sin(turn)
            across = (away[1] * math.cos(turn) - away[0] * math.sin(turn)) * stretch
            rest = 1 - along**2 - across**2 - sum(c * c for c in away[2:])
            if rest <= 0:
                continue
            sign = -1.0 if more & 1 else 1.0
            if waves:
                tilt = turn + (2 * ((more >> 16) + 0.5) / 65536 - 1) * math.radians(p.spread)
                phase = ((more & 0xFFFF) + 0.5) / 65536
                sign = math.cos(2 * math.pi * (waves * (away[0] * math.cos(tilt) + away[1] * math.sin(tilt)) + phase))
            total += sign * rest**3
    window = math.pi ** (d / 2) * math.gamma(7) / math.gamma(d / 2 + 7)
    deviation = math.sqrt(p.impulses * window / stretch * (0.5 if waves else 1.0))
    return min(max(total / (4 * deviation), -1.0), 1.0)


HALF = "334 -1528 410 3545 -938 -8233 2172 19120 -5040 -44412 11655 103311 -25936 -243780 33979 655340"
"""Millionths of the filter that is printed with Wavelet noise, its first half."""
DOWN = [int(word) / 1e6 for word in HALF.split()]
DOWN += DOWN[::-1]


def _spline(at: Fraction) -> dict[int, float]:
    """Weights of cells by a quadratic B-spline around the middle of each."""
    cell, t = math.floor(at), float(at - math.floor(at))
    return {cell - 1: (1 - t) ** 2 / 2, cell: 1 - (1 - t) ** 2 / 2 - t * t / 2, cell + 1: t * t / 2}


def _coarse(fine: dict[int, float], parity: int) -> dict[int, float]:
    """Weights of cells when they are first taken to the cells of this parity and back."""
    coarse: dict[int, float] = {}
    for cell, weight in fine.items():
        for up, share in zip((-2, -1, 0, 1), (0.25, 0.75, 0.75, 0.25), strict=True):
            if (cell - up - parity) % 2 == 0:
                coarse[cell - up] = coarse.get(cell - up, 0.0) + weight * share
    found: dict[int, float] = {}
    for cell, weight in coarse.items():
        for down, share in enumerate(DOWN, start=-16):
            found[cell + down] = found.get(cell + down, 0.0) + weight * share
    return found


def wavelet(at: Place, key: Key, p: Any) -> float:
    """All signs that a place can feel, each by what it weighs: plainly, less through the coarse lattice."""
    axes = min(len(at), 3) if p.depth == "solid" else 2
    plain = [_spline(c) for c in at]
    low = [{parity: _coarse(weights, parity) for parity in (0, 1)} for weights in plain[:axes]]
    reach = [sorted(set(both[0]) | set(both[1])) for both in low] + [sorted(weights) for weights in plain[axes:]]
    cells = product(*reach)
    words = np.array([point(key, (cell[0] % 128, cell[1] % 128, *cell[2:])) for cell in cells], np.uint64)
    words = words.reshape([len(each) for each in reach])

    def together(chosen: list[dict[int, float]]) -> Any:
        rows = [np.array([weights.get(c, 0.0) for c in each]) for weights, each in zip(chosen, reach, strict=True)]
        return reduce(np.multiply.outer, rows)

    total = 0.0
    for parities in product((0, 1), repeat=axes):
        x, y, *others = parities
        bit = 2 * y + x + 4 * sum(parity << place for place, parity in enumerate(reversed(others)))
        coarse = [both[parity] for both, parity in zip(low, parities, strict=True)]
        signs = 1 - 2.0 * ((words >> np.uint64(bit)) & np.uint64(1))
        total += (signs * (together(plain) - together(coarse + plain[axes:]))).sum()
    size = math.sqrt(math.prod(sum(w * w for w in weights.values()) for weights in plain[axes:]))
    deviation = math.sqrt(0.55**axes - 0.409307**axes)
    return float(min(max(total / math.sqrt(2**axes) / size / (4 * deviation), -1.0), 1.0))


BASES = {
    "value_noise": value,
    "perlin_noise": perlin,
    "simplex_noise": simplex,
    "worley_noise": worley,
    "spot_noise": sparse,
    "gabor_noise": sparse,
    "wavelet_noise": wavelet,
}


def octave(name: str, p: Any, k: int, column: int, row: int, stream: int = 0) -> float:
    """Octave k of a basis at the centre of a pixel, of a picture that does not repeat."""
    scale = p.lacunarity**k
    across, down = (scale / side for side in p.cells)
    if name == "simplex_noise" and p.dimensions == 2:
        down *= 1 / (math.sqrt(3) / 2)
    shifts = [0.0] * 4
    if k:
        words = (*pcg3d(p.seed, k, 0x5EED), pcg3d(p.seed, k, 0x5EEE)[0])
        shifts = [(word >> 8) / 2**24 for word in words]
    half = Fraction(1, 2)
    places = (
        (Fraction(p.x) + column + half) * Fraction(across),
        (Fraction(p.y) + row + half) * Fraction(down),
        Fraction(p.z) * Fraction(scale),
        Fraction(p.w) * Fraction(scale),
    )
    at = tuple(c + Fraction(s) for c, s in zip(places, shifts, strict=True))[: p.dimensions]
    return BASES[name](at, pcg2d(p.seed, 64 * stream + k), p)


def fbm(name: str, p: Any, column: int, row: int) -> float:
    amplitudes = [p.gain**k for k in range(p.octaves)]
    terms = [a * octave(name, p, k, column, row) for k, a in enumerate(amplitudes)]
    return p.low + (p.high - p.low) * (sum(terms) / sum(amplitudes) + 1) / 2
