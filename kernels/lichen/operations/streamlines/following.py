"""Line integral convolution in NumPy: all lines of an image, followed at once in blocks."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operations.streamlines.lines import (
    Advance,
    Cells,
    Flow,
    Grid,
    Index,
    border_share,
    critical_share,
    displacements,
    texture_cells,
)
from lichen.operations.streamlines.task import Task, decode


class Lines:
    """The lines of a task, in equal steps no longer than `step`, in arithmetic of `dtype`."""

    block: ClassVar[int] = 1 << 14
    """Pixels followed together: what stays in cache."""

    def __init__(self, task: Task, step: float, dtype: npt.DTypeLike) -> None:
        p = task.p
        self.task, self.arc = task, task.arc
        self.dtype: np.dtype[Any] = np.dtype(dtype)
        self.field = Grid.of(task.vectors(dtype), p.field_sampling, task.wraps)
        later = None
        if task.later is not None:
            later = Grid.of(decode(task.later, p, task.limit, dtype), p.field_sampling, task.wraps)
        self.flow = Flow(self.field, later, task.time, p.interval or 1.0)
        self.texture = Grid.of(task.texels(dtype), p.sampling, task.wraps)
        self.count = p.steps(step)
        self.step = p.length / max(self.count, 1)
        self.weights = task.weights(self.count).astype(dtype)

    def convolve(self, advance: Advance) -> Array:
        """The result by the Runge-Kutta method `advance`, (height, width, channels)."""
        pixels = np.arange(self.field.height * self.field.width)
        blocks = np.split(pixels, range(self.block, len(pixels), self.block))
        with np.errstate(all="ignore"):  # NaN and infinity are values here
            rows = [self._convolve(block, advance) for block in blocks]
        return np.concatenate(rows).reshape(self.field.height, self.field.width, -1)

    def _convolve(self, pixels: Index, advance: Advance) -> Array:
        field = self.field
        cells = (pixels % field.width, pixels // field.width)
        read = Reader(self.texture, field, cells, self.dtype)
        own = read.own
        total, weight = np.zeros_like(own), np.zeros_like(own[:, :1])
        for sign, k in zip((1.0, -1.0), self.weights, strict=True):
            step = sign * self.step
            at, alive = np.zeros((len(pixels), 2), self.dtype), np.ones(len(pixels), bool)
            last, here = own - own, self.flow.at(cells, at, 0.0)
            for j in range(self.count):

                def slope(at: Array, part: float, j: int = j, step: float = step) -> Array:
                    return displacements(self.flow.at(cells, at, (j + part) * step), step, self.arc)

                moves = advance(slope, at, displacements(here, step, self.arc))
                there = self.flow.at(cells, at + moves, (j + 1) * step)
                share = np.minimum(border_share(field, cells, at, moves), critical_share(here, there, moves, sign))
                share = np.where(alive & (share > 0), share, 0)[:, None].astype(self.dtype)
                at = np.where(share > 0, at + share * moves, at)
                sample = read(at) - own
                end = k[j] + share * (k[j + 1] - k[j])
                total += np.where(share > 0, share / 2 * (k[j] * last + end * sample), 0)
                weight += share / 2 * (k[j] + end)
                alive, here, last = share[:, 0] == 1, there, sample
                if not alive.any():
                    break
        return np.where(weight > 0, own + total / weight, own)

    def walk(self) -> Array:
        """The result by Euler's steps through the vectors of whole pixels, reading whole texels."""
        field, texture = self.field, self.texture
        size, texels = np.array([field.width, field.height]), np.array([texture.width, texture.height])
        start = np.stack(np.meshgrid(np.arange(field.width), np.arange(field.height)), axis=-1).reshape(-1, 2)
        same, scale = (size == texels).all(), (texels / size).astype(self.dtype)

        def cell(at: Array) -> Index:
            column, row = (start + np.floor(at).astype(np.int64)).T
            return np.asarray(row * field.width + column)

        def read(at: Array) -> Array:
            column, row = np.minimum(((start + at).astype(self.dtype) * scale).astype(np.int64), texels - 1).T
            return texture.samples.take(cell(at) if same else row * texture.width + column, axis=0)

        with np.errstate(all="ignore"):
            steps = displacements(field.samples, self.step, self.arc)
            steps = np.where(np.isnan(steps), 0, steps)
            origin = np.full(start.shape, 0.5, self.dtype)  # from the corner of the pixel
            own = read(origin)
            total, weight = np.zeros_like(own), np.zeros_like(own[:, :1])
            for sign, k in zip((1, -1), trapezoid(self.weights), strict=True):
                weight += k[0]
                at, move = origin, steps
                alive = (move != 0).any(axis=1, keepdims=True)
                for j in range(1, self.count + 1):
                    ahead = at + sign * move
                    alive = alive & ((ahead >= -start) & (ahead < size - start)).all(axis=1, keepdims=True)
                    at = np.where(alive, ahead, at)
                    share = np.where(alive, k[j], 0).astype(self.dtype)
                    total += np.where(share != 0, share * (read(at) - own), 0)
                    weight += share
                    further = steps[cell(at)]
                    alive = alive & ((further * move).sum(axis=1, keepdims=True) > 0)
                    move = further
            mean: Array = np.where(weight > 0, own + total / weight, own)
        return mean.reshape(field.height, field.width, -1)


class Reader:
    """Texels at displacements (n, 2), in pixels of the field, from the centres of the field's cells."""

    def __init__(self, texture: Grid, field: Grid, cells: Cells, dtype: npt.DTypeLike) -> None:
        columns, x = texture_cells(cells[0], field.width, texture.width, dtype)
        rows, y = texture_cells(cells[1], field.height, texture.height, dtype)
        self._texture, self._cells = texture, (columns, rows)
        self._x, self._y = x, y
        self._scale = np.array([texture.width / field.width, texture.height / field.height], dtype)
        self.own: Array = texture.at(self._cells, x, y)

    def __call__(self, at: Array) -> Array:
        x, y = self._x + self._scale[0] * at[:, 0], self._y + self._scale[1] * at[:, 1]
        return self._texture.at(self._cells, x, y)


def trapezoid(weights: Array) -> Array:
    """Weights of single samples on both halves of a line: the ends count half, and so does the start on each half. None
    where the line has no length."""
    halved = weights / 2
    halved[:, 1:-1] *= 2
    return halved if weights.shape[1] > 1 else np.zeros_like(weights)
