"""A picture of summed octaves with NumPy: what truth does in doubles, and the methods in their own precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.memory import Array, aligned_empty
from lichen.operations.noise.basis import Basis, Place, Slice
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.fractal import Shape, Summing, shaped
from lichen.operations.noise.octaves import Cut, Octave
from lichen.operations.noise.parameters import Fractal, LatticeParameters, Output

BLOCK = 1 << 15
"""Pixels that are worked on at once, so that the steps stay in cache."""


@dataclass(frozen=True, slots=True)
class Placed:
    """One octave of one picture, on its lattice."""

    octave: Octave
    x: Axis
    y: Axis
    slices: tuple[Slice, ...]

    def block(self, start: int, stop: int, moved: Array | None, dtype: np.dtype[np.floating]) -> Place:
        """Rows of the picture; `moved` says by how many px along x and y, shape (2, rows, width)."""
        rows = self.y.rows(start, stop)
        x_cells, x = self.x.cells[None, :], self.x.fractions[None, :].astype(dtype)
        y_cells, y = rows.cells, rows.fractions.astype(dtype)
        if moved is not None:
            x_cells, x = _carried(x_cells, x + moved[0] * self.octave.frequency[0])
            y_cells, y = _carried(y_cells, y + moved[1] * self.octave.frequency[1])
        return Place(x_cells, x, y_cells, y, self.x.period, self.y.period, self.slices)


def _carried(cells: Array, fractions: Array) -> tuple[Array, Array]:
    whole = np.floor(fractions)
    return cells + whole.astype(np.int64), fractions - whole


def placed(p: Any, basis: Basis[Any], cut: Cut, stream: int) -> tuple[Placed, ...]:
    """The computed octaves on their lattices."""
    found = []
    for octave in cut.computed:
        axes = octave.axes(p)
        found.append(Placed(octave, axes[0], axes[1], basis.slices(p, octave.key(p, stream), axes)))
    return tuple(found)


def plain(p: LatticeParameters) -> Fractal:
    """How the noise that moves places is summed: without creases."""
    return Fractal.NONE if p.fractal is Fractal.NONE else Fractal.FBM


def shapes(p: Any, basis: Basis[Any], cut: Cut) -> tuple[Shape, Shape]:
    """The sum of the picture, and that of what moves its places."""
    whole = not cut.left and all(octave.kept == 1 for octave in cut.computed)
    means = (0.0, 0.0) if whole else basis.mean(p)  # where nothing stands for an octave, none is looked for
    return shaped(p.fractal, cut, *means), shaped(plain(p), cut, *means)


def picture(p: Any, basis: Basis[Any], cut: Cut, dtype: Any) -> Array:
    """The picture, (height, width, channels) of `dtype`."""
    kind = np.dtype(dtype)
    out = aligned_empty((p.height, p.width, p.channels), kind)
    derivatives = p.output is Output.DERIVATIVES
    own, moving = shapes(p, basis, cut)
    lattices = placed(p, basis, cut, 0)
    movers = [placed(p, basis, cut, stream) for stream in (1, 2)] if p.warp else []
    rows = max(1, BLOCK // p.width)
    with np.errstate(all="ignore"):
        for start in range(0, p.height, rows):
            stop = min(start + rows, p.height)
            block = _Block(p, basis, start, stop, kind, derivatives)
            moved = [block.planes(each, moving, None) for each in movers]
            shift = np.stack([p.warp * each[0] for each in moved]) if moved else None
            planes = block.planes(lattices, own, shift)
            if moved and derivatives:
                planes[1:] = _turned(planes[1:], moved, p.warp)
            out[start:stop, :, 0] = p.middle + p.half * planes[0]
            for channel, plane in enumerate(planes[1:], start=1):
                out[start:stop, :, channel] = p.half * plane
    return out


def _turned(slopes: list[Array], moved: list[list[Array]], warp: float) -> list[Array]:
    """Derivatives along the picture's axes, from those at the moved places."""
    (_, x_x, x_y), (_, y_x, y_y) = moved
    along_x, along_y = slopes
    return [
        along_x + warp * (along_x * x_x + along_y * y_x),
        along_y + warp * (along_x * x_y + along_y * y_y),
    ]


@dataclass(frozen=True, slots=True)
class _Block:
    """Some rows of the picture."""

    p: Any
    basis: Basis[Any]
    start: int
    stop: int
    kind: np.dtype[Any]
    derivatives: bool

    def planes(self, lattices: tuple[Placed, ...], shape: Shape, moved: Array | None) -> list[Array]:
        """The noise, and its derivatives per px if they are asked for."""
        total = Summing(shape, (self.stop - self.start, self.p.width), self.kind, self.derivatives)
        for number, each in enumerate(lattices):
            place = each.block(self.start, self.stop, moved, self.kind)
            total.add(self.basis.evaluate(place, self.p, self.derivatives), each.octave, number)
        return total.finish()
