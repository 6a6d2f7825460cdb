"""Worley noise: how far the nearest of strewn points is.

Truth: every cell holds one point, at 1/2 + jitter (h - 1/2) along each axis, with h of 16 bits from the cell's hash. F1
and F2 are the distances to the nearest and the second nearest point. n = 2 F / B - 1, where F is F1, F2 or F2 - F1 and
B the largest F there can be, so n lies in [-1, 1].

Bounds: the point of a place's own cell is at most 1/2 + jitter / 2 away along each axis, which bounds F1. The neighbour
across the nearest face, t <= 1/2 away, is at most t + 1/2 + jitter / 2 away along that axis and 1/2 - t + jitter / 2
along the others, which bounds F2; both ends of t are tried, since that distance is convex in t.

Search: the 3^d cells around a place leave out what is more than 1 + t away, so they are enough where the distance
wanted is no larger, and for Chebyshev distances always. Elsewhere the bounds say how many more rings of cells are
needed: one for Euclidean distances, up to d - 1 for Manhattan. Methods look there only where it is called for. The
method `near` never does: it is what most programs compute.

F has creases, where the nearest point changes; derivatives jump there, and are 0 on a point itself.

Sources: Worley, A cellular texture basis function, SIGGRAPH 1996; octaves.py and fractal.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product

import numpy as np
from pydantic import Field

from lichen.hashing import keyed, pcg
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import Error, InputFacts, Inputs, Rate
from lichen.operations.noise.basis import Basis, Place, Slice, Values, corners, padded
from lichen.operations.noise.cases import lattice_cases
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.declare import declared, work
from lichen.operations.noise.errors import error, factor
from lichen.operations.noise.launch import Task
from lichen.operations.noise.means import mean, mean_magnitude
from lichen.operations.noise.octaves import Key, Lattice, visible
from lichen.operations.noise.parameters import Fractal, LatticeParameters, Output
from lichen.operations.noise.summing import picture


class Metric(StrEnum):
    """How far a way is."""

    EUCLIDEAN = "euclidean"
    """the root of the sum of squares: round cells"""
    MANHATTAN = "manhattan"
    """the sum of magnitudes: diamonds"""
    CHEBYSHEV = "chebyshev"
    """the largest magnitude: squares"""


class Feature(StrEnum):
    """Which distance."""

    F1 = "f1"
    """to the nearest point: cobbles"""
    F2 = "f2"
    """to the second nearest"""
    F2_F1 = "f2-f1"
    """how much farther the second is: 0 along the borders between cells"""


class Parameters(LatticeParameters):
    metric: Metric = Field(Metric.EUCLIDEAN, description="how far a way is")
    feature: Feature = Field(Feature.F1, description="which distance is shown")
    jitter: float = Field(1.0, ge=0, le=1, description="how far points stray from the middle of their cells")


# ---------------------------------------------------------------------------------------------------------- distances


def _length(p: Parameters, ways: list[float]) -> float:
    if p.metric is Metric.EUCLIDEAN:
        return math.sqrt(math.fsum(way * way for way in ways))
    return math.fsum(ways) if p.metric is Metric.MANHATTAN else max(ways)


def bound(p: Parameters) -> float:
    """The largest distance, or difference of distances, there can be."""
    others = p.dimensions - 1
    own = _length(p, [0.5 + p.jitter / 2] * p.dimensions)
    if p.feature is Feature.F1:
        return own
    return max(own, _length(p, [1 + p.jitter / 2] + [p.jitter / 2] * others))


def rings(p: Parameters) -> int:
    """Rings of cells around its own that hold whatever can be nearest or second nearest to a place."""
    if p.metric is Metric.CHEBYSHEV:
        return 1
    return p.dimensions if p.metric is Metric.MANHATTAN else 2


def slices(p: Parameters, key: Key, axes: tuple[Axis, ...]) -> tuple[Slice, ...]:
    return _around(rings(p), key, axes)


def _around(around: int, key: Key, axes: tuple[Axis, ...]) -> tuple[Slice, ...]:
    """The cells around z and w; a slice's weight is its ring."""
    found = []
    for own, away in corners(key, axes, tuple(range(-around, around + 1))):
        ring = max((abs(round(float(a.fractions[0]) - d)) for d, a in zip(away, axes[2:], strict=True)), default=0)
        found.append(Slice(own, weight=float(ring), **padded(away)))
    return tuple(found)


# ---------------------------------------------------------------------------------------------------------- the search


@dataclass(slots=True)
class Nearest:
    """The two nearest points so far: distances (Euclidean ones squared), and the ways along x and y."""

    first: Array
    second: Array
    ways: tuple[Array, Array] | None
    second_ways: tuple[Array, Array] | None

    def look(self, far: Array, ways: tuple[Array, Array] | None) -> None:
        if ways is not None and self.ways is not None and self.second_ways is not None:
            nearer, between = far < self.first, far < self.second
            pairs = list(zip(self.ways, self.second_ways, ways, strict=True))
            x, y = (np.where(nearer, own, np.where(between, new, old)) for own, old, new in pairs)
            self.second_ways = (x, y)
            x, y = (np.where(nearer, new, own) for own, _, new in pairs)
            self.ways = (x, y)
        self.second = np.minimum(self.second, np.maximum(self.first, far))
        self.first = np.minimum(self.first, far)


def _measured(p: Parameters, ways: list[Array], derivatives: bool) -> tuple[Array, tuple[Array, Array] | None]:
    x, y = ways[:2]
    if p.metric is Metric.EUCLIDEAN:
        far = x * x + y * y
        for way in ways[2:]:
            far = far + way * way
        return far, (x, y) if derivatives else None
    sizes = [np.abs(way) for way in ways]
    if p.metric is Metric.MANHATTAN:
        return np.asarray(sum(sizes[1:], sizes[0])), (np.sign(x), np.sign(y)) if derivatives else None
    far = np.maximum(sizes[0], sizes[1])
    for size in sizes[2:]:
        far = np.maximum(far, size)
    if not derivatives:
        return far, None
    leads = sizes[0] == far
    return far, (np.where(leads, np.sign(x), 0), np.where(~leads & (sizes[1] == far), np.sign(y), 0))


def _search(place: Place, p: Parameters, found: Nearest, derivatives: bool, *, outer: bool) -> None:
    """The cells of the first ring, or those of all rings beyond it."""
    kind = place.x.dtype.type
    step = p.jitter / 65536
    origin = 0.5 - p.jitter / 2 + step / 2
    reach = rings(p) if outer else 1
    for part in place.slices:
        if part.weight > 1 and not outer:
            continue
        for j, i in product(range(-reach, reach + 1), repeat=2):
            if outer and part.weight <= 1 and abs(j) <= 1 and abs(i) <= 1:
                continue
            h = keyed(place.column(i), *place.row(part, j))
            ways = [
                (h & np.uint32(0xFFFF)).astype(kind) * kind(step) + (i - place.x + kind(origin)),
                (h >> np.uint32(16)).astype(kind) * kind(step) + (j - place.y + kind(origin)),
            ]
            if p.dimensions > 2:
                g = pcg(h)
                further = ((g & np.uint32(0xFFFF), part.z), (g >> np.uint32(16), part.w))[: p.dimensions - 2]
                ways += [bits.astype(kind) * kind(step) + kind(origin - away) for bits, away in further]
            found.look(*_measured(p, ways, derivatives))


def _border(place: Place, p: Parameters) -> Array:
    """The distance from a place to the second ring."""
    own = next(part for part in place.slices if part.weight == 0)
    sides = [place.x, 1 - place.x, place.y, 1 - place.y]
    for away in (own.z, own.w)[: p.dimensions - 2]:
        sides += [place.x.dtype.type(away), place.x.dtype.type(1 - away)]
    least = sides[0]
    for side in sides[1:]:
        least = np.minimum(least, side)
    return np.asarray(1 + least)


def evaluate(place: Place, p: Parameters, derivatives: bool) -> Values:
    """Every ring that can matter."""
    found = _inner(place, p, derivatives)
    border = _border(place, p)
    wanted = found.first if p.feature is Feature.F1 else found.second
    far = wanted > (border * border if p.metric is Metric.EUCLIDEAN else border)
    if rings(p) > 1 and far.any():
        _search_some(place, p, found, derivatives, np.broadcast_to(far, found.first.shape))
    return _shown(p, found, derivatives)


def evaluate_near(place: Place, p: Parameters, derivatives: bool) -> Values:
    """The first ring alone."""
    return _shown(p, _inner(place, p, derivatives), derivatives)


def _inner(place: Place, p: Parameters, derivatives: bool) -> Nearest:
    size = np.broadcast_shapes(place.x.shape, place.y.shape)
    kind = place.x.dtype

    def empty() -> tuple[Array, Array] | None:
        return (np.zeros(size, kind), np.zeros(size, kind)) if derivatives else None

    found = Nearest(np.full(size, 1e9, kind), np.full(size, 1e9, kind), empty(), empty())
    _search(place, p, found, derivatives, outer=False)
    return found


def _search_some(place: Place, p: Parameters, found: Nearest, derivatives: bool, at: Array) -> None:
    """The outer rings, for some places only."""

    def spread(each: Array) -> Array:
        return np.broadcast_to(each, at.shape)[at]

    def some(pair: tuple[Array, Array] | None) -> tuple[Array, Array] | None:
        return None if pair is None else (pair[0][at], pair[1][at])

    part = Nearest(found.first[at], found.second[at], some(found.ways), some(found.second_ways))
    few = replace(
        place, x_cells=spread(place.x_cells), x=spread(place.x), y_cells=spread(place.y_cells), y=spread(place.y)
    )
    _search(few, p, part, derivatives, outer=True)
    found.first[at], found.second[at] = part.first, part.second
    for whole, some_of_it in ((found.ways, part.ways), (found.second_ways, part.second_ways)):
        if whole is not None and some_of_it is not None:
            whole[0][at], whole[1][at] = some_of_it


def _shown(p: Parameters, found: Nearest, derivatives: bool) -> Values:
    """The noise from the two distances, and its derivatives: a distance grows against the way to its point."""
    first, second = found.first, found.second
    ways, second_ways = found.ways, found.second_ways
    if p.metric is Metric.EUCLIDEAN:
        first, second = np.sqrt(first), np.sqrt(second)
        ways, second_ways = _directions(ways, first), _directions(second_ways, second)
    scale = 2 / bound(p)
    value = {Feature.F1: first, Feature.F2: second, Feature.F2_F1: second - first}[p.feature]
    if ways is None or second_ways is None:
        return value * scale - 1, None, None
    pairs = zip(ways, second_ways, strict=True)
    if p.feature is Feature.F2_F1:
        x, y = ((one - two) * scale for one, two in pairs)
    else:
        x, y = (-(one if p.feature is Feature.F1 else two) * scale for one, two in pairs)
    return value * scale - 1, x, y


def _directions(ways: tuple[Array, Array] | None, far: Array) -> tuple[Array, Array] | None:
    if ways is None:
        return None
    x, y = (np.divide(way, far, out=np.zeros_like(way), where=far > 0) for way in ways)
    return x, y


# -------------------------------------------------------------------------------------------------------- declaration

_METRICS = {each: number for number, each in enumerate(Metric)}
BANDS = {Feature.F1: 1.5, Feature.F2: 1.5, Feature.F2_F1: 1.9}


def _rounding(p: Parameters) -> float:
    """Each way carries roundings of numbers up to `rings` + 1 in size, and a distance changes by no more than all of
    them together; its root and the rest add four of its own size."""
    both = 2 if p.feature is Feature.F2_F1 else 1
    return both * (p.dimensions * 4.0 * (rings(p) + 1) + 4 * bound(p)) * 2 / bound(p) + 4


def _numbers(p: Parameters, reach: int | None = None) -> tuple[float, ...]:
    """The jitter, the shares of F1 and F2, the metric, and how many rings are searched."""
    scale = 2 / bound(p)
    first = {Feature.F1: scale, Feature.F2: 0.0, Feature.F2_F1: -scale}[p.feature]
    second = 0.0 if p.feature is Feature.F1 else scale
    return p.jitter, first, second, float(_METRICS[p.metric]), float(reach or rings(p))


def _work(p: Parameters) -> float:
    return 1.2 * 3.0**p.dimensions * (1.3 if p.dimensions > 2 else 1.0)


BASIS: Basis[Parameters] = Basis(
    lattice=lambda p: Lattice(BANDS[p.feature]),
    slices=slices,
    evaluate=evaluate,
    mean=lambda p: (mean(BASIS, p), mean_magnitude(BASIS, p)),
    slope=lambda p: (2 if p.feature is Feature.F2_F1 else 1) * 2 / bound(p),
    rounding=_rounding,
    slope_rounding=lambda p: None,
    work=_work,
    defines=lambda p: {"BASIS": 2},
    numbers=_numbers,
)  # fmt: skip

worley_noise = declared(
    BASIS,
    name="worley_noise",
    summary="Worley noise: distances to the nearest of strewn points, as cobbles, cells and cracks; tileable.",
    description=__doc__ or "",
    parameters=Parameters,
    examples=(
        {"width": 96, "height": 64, "cell": 24, "octaves": 1},
        {"width": 64, "height": 64, "cell": 16, "tile": True, "feature": "f2-f1", "fractal": "none"},
        {"width": 40, "height": 32, "cell": 12, "dimensions": 3, "z": 0.37, "octaves": 2, "metric": "manhattan",
         "feature": "f2"},
        {"width": 48, "height": 40, "cell": 12, "metric": "chebyshev", "jitter": 0.6, "octaves": 3, "warp": 4,
         "output": "derivatives"},
    ),
    hard_cases=lattice_cases(),
    rates={
        "opencl": (Rate(5e-4, 4.0e-10), Rate(5e-4, 6.5e-10)),
        "numpy": (Rate(5e-4, 2.2e-8), Rate(5e-4, 2.8e-8)),
    },
)  # fmt: skip

NEAR = replace(
    BASIS,
    slices=lambda p, key, axes: _around(1, key, axes),
    evaluate=evaluate_near,
    numbers=lambda p: _numbers(p, 1),
)
MISSED = {Metric.EUCLIDEAN: 4e-4, Metric.MANHATTAN: 3.3e-3, Metric.CHEBYSHEV: 0.0}
"""RMS of what the first ring misses, over the range: the worst of two to four dimensions and all features, at 2 10^5
places, points straying all they may."""


def _near_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A point beyond the first ring is more than 1 away, and what is taken for it no farther than the bound; below a
    bound of 1 nothing is missed."""
    exact = error(p, BASIS, 0.0, double=False)
    first = max(bound(p.model_copy(update={"feature": Feature.F1})) - 1, 0.0)
    missed = (max(bound(p) - 1, 0.0) + (first if p.feature is Feature.F2_F1 else 0)) * 2 / bound(p)
    if p.output is Output.DERIVATIVES or p.warp or p.fractal is Fractal.RIDGED:
        missed = 2.0
    missed = min(missed * factor(p), 2.0)
    typical = exact.usual + 2 * abs(p.half) * MISSED[p.metric] * factor(p)
    return Error(abs(p.half) * missed + exact.value, "bound", exact.rounding, typical)


@worley_noise.method(
    "near",
    error=_near_error,
    work=lambda p, knob, facts: work(NEAR, p, visible(p, NEAR.lattice(p))),
    rates={"opencl": Rate(5e-4, 3.6e-10), "numpy": Rate(5e-4, 1.4e-8)},
    unfit=lambda p, facts: "the first ring of cells is always enough for it" if rings(p) == 1 else None,
)
class Near:
    """Float32; the first ring of cells alone, which misses a point that lies farther."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Task(p, NEAR, visible(p, NEAR.lattice(p)), np.float32).run(device)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return picture(p, NEAR, visible(p, NEAR.lattice(p)), np.float32)
