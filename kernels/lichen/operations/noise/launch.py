"""A picture of summed octaves on an OpenCL device: the launches of sum.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operations.noise.basis import Basis
from lichen.operations.noise.fractal import Shape
from lichen.operations.noise.octaves import Cut
from lichen.operations.noise.parameters import Fractal, Output
from lichen.operations.noise.summing import Placed, placed, shapes

SOURCE = "noise/sum.cl"
SEGMENT = 64
"""Pixels of a work-item; `SEGMENT` in sum.cl."""
LANES = 16
LOCAL = (16,)
FRACTALS = {each: number for number, each in enumerate(Fractal)}


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """One picture in one precision."""

    p: Any
    basis: Basis[Any]
    cut: Cut
    dtype: Any

    @property
    def stride(self) -> int:
        """Pixels from row to row of a plane, so that whole vectors are read."""
        width: int = self.p.width
        return -(-width // SEGMENT) * SEGMENT

    def run(self, device: Device) -> Array:
        out = aligned_empty((self.p.height, self.p.width, self.p.channels))
        own, moving = shapes(self.p, self.basis, self.cut)
        with device.session() as session:
            moved: list[Array | None] = [None, None]
            if self.p.warp:
                moved = [self._planes(session, moving, stream) for stream in (1, 2)]
            self._launch(session, own, 0, moved, None, out)
        return out

    def _planes(self, session: Session, shape: Shape, stream: int) -> Array:
        planes = session.scratch((self.p.channels, self.p.height, self.stride), self.dtype)
        self._launch(session, shape, stream, [None, None], planes, None)
        return planes

    def _launch(
        self, session: Session, shape: Shape, stream: int, moved: list[Array | None], planes: Array | None,
        out: Array | None,
    ) -> None:  # fmt: skip
        p, real = self.p, np.dtype(self.dtype).type
        lattices = placed(p, self.basis, self.cut, stream)
        middle, half = (p.middle, p.half) if planes is None else (0.0, 1.0)
        parts = len(lattices[0].slices) if lattices else 1
        integers = (
            p.width, p.height, self.stride, p.channels, len(lattices), len(shape.left), FRACTALS[shape.fractal],
            p.dimensions, parts,
        )  # fmt: skip
        tables = self._tables(lattices)
        sizes = (0, 0) if tables is None else tables.shape[1:]
        session.launch(
            SOURCE, "sum", (-(-p.width // SEGMENT) * p.height,),
            *self._axes(lattices), *self._slices(lattices), self._terms(shape, lattices), self._own(), tables, *moved,
            planes if planes is None else session.write(planes), out if out is None else session.write(out),
            *(np.int32(n) for n in (*integers, *sizes)),
            *(real(n) for n in (shape.start, shape.mean, middle, half, p.warp)),
            local=LOCAL, defines=self._defines(warped=moved[0] is not None),
        )  # fmt: skip

    def _defines(self, *, warped: bool) -> dict[str, int]:
        """Of the program. Derivatives in doubles come from the one that can move places, too, and that one always has
        them: a rarely used program less is a second less to wait."""
        double, derivatives = np.dtype(self.dtype) == np.float64, self.p.output is Output.DERIVATIVES
        warped = warped or (double and derivatives)
        return {
            **self.basis.defines(self.p),
            "DOUBLE": int(double),
            "HIGHER": int(self.p.dimensions > 2),
            "DERIVATIVES": int(derivatives or warped),
            "WARPED": int(warped),
        }

    def _axes(self, lattices: tuple[Placed, ...]) -> tuple[Array, Array, Array, Array]:
        """Cells and fractions of all columns, filled up to whole vectors, and of all rows, octave by octave."""
        count = max(len(lattices), 1)
        columns = aligned_empty((count, self.stride), np.int32), aligned_empty((count, self.stride), self.dtype)
        rows = aligned_empty((count, self.p.height), np.int32), aligned_empty((count, self.p.height), self.dtype)
        for cells, fractions in (columns, rows):
            cells[...], fractions[...] = 0, 0
        for k, each in enumerate(lattices):
            for axis, (cells, fractions) in ((each.x, columns), (each.y, rows)):
                cells[k, : axis.cells.size] = axis.cells.astype(np.int32, casting="unsafe")
                fractions[k, : axis.cells.size] = axis.fractions
        return *columns, *rows

    def _slices(self, lattices: tuple[Placed, ...]) -> tuple[Array, Array]:
        """Keys of all slices, and their distances, weights, whether they are centred and the sizes of their tables,
        octave by octave."""
        found = [part for each in lattices for part in each.slices]
        keys, places = (
            aligned_empty((max(len(found), 1), 2), np.uint32),
            aligned_empty((max(len(found), 1), 6), self.dtype),
        )
        for at, part in enumerate(found):
            keys[at] = part.key
            sizes = (0, 0) if part.table is None else part.table.shape
            places[at] = part.z, part.w, part.weight, part.centred, *sizes
        return keys, places

    def _tables(self, lattices: tuple[Placed, ...]) -> Array | None:
        """Tables of all octaves, their first columns repeated after the last, so that neighbours are beside each
        other."""
        found = [part.table for each in lattices for part in each.slices if part.table is not None]
        if not found:
            return None
        rows, columns = (max(each.shape[axis] for each in found) for axis in (0, 1))
        tables = aligned_empty((len(found), rows, -(-(columns + 2) // LANES) * LANES), self.dtype)
        tables[...] = 0
        for at, table in enumerate(found):
            down, across = table.shape
            tables[at, :down, : across + 2] = np.concatenate([table, table[:, :2]], axis=1)
        return tables

    def _own(self) -> Array:
        """The numbers of the basis."""
        numbers = self.basis.numbers(self.p)
        own = aligned_empty((len(numbers),), self.dtype)
        own[...] = numbers
        return own

    def _terms(self, shape: Shape, lattices: tuple[Placed, ...]) -> Array:
        """Eight numbers for each octave: `Octave` in sum.cl. Octaves that are left out have an amplitude alone."""
        terms = aligned_empty((max(len(lattices) + len(shape.left), 1), 8), self.dtype)
        terms[...] = 0
        for at, (each, term) in enumerate(zip(lattices, shape.terms, strict=True)):
            octave = each.octave
            terms[at, :7] = (term.factor, term.amplitude, term.kept, *octave.frequency, *octave.period[:2])
        for at, amplitude in enumerate(shape.left, start=len(lattices)):
            terms[at, 1] = amplitude
        return terms
