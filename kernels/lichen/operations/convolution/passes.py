"""One pass of a symmetric kernel along one axis, and the products that transforms and long kernels come down to.

`Steps` are the kernels of `passes.cl` and `products.cl` in a session; without a device OpenCV's loops do the same. A
kernel longer than the image is folded onto it by the border rule, which is exact and bounds the work.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import as_strided

from lichen.image import Image, StoredImage
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.stencil import (
    BLOCK,
    NEAR,
    STAGE,
    TILE,
    WIDE,
    Stencil,
    banded,
    correlate,
    gathering,
    stride_of,
)
from lichen.stage import Tail

Vector = npt.NDArray[np.float64]


def folded(weights: Vector, size: int, border: Border) -> tuple[Vector, Vector]:
    """The (size, size) matrix of one pass with every tap folded onto the image, and the constant's weight per row."""
    taps = np.arange(len(weights)) - len(weights) // 2
    period = {Border.REFLECT: 2 * size, Border.REFLECT101: max(2 * size - 2, 1), Border.WRAP: size}.get(border)
    # Beyond one period taps repeat; beyond the image those of the other borders all read the same.
    taps = taps % period if period else np.clip(taps, -size, size)
    lowest = int(taps.min())
    merged = np.bincount(taps - lowest, weights)
    # Row i of the unfolded matrix holds `merged` from column i on; it is a view, since most of it is zero.
    padded = np.pad(merged, size - 1)
    width, item = len(merged) + size - 1, padded.itemsize
    unfolded = as_strided(padded[size - 1 :], (size, width), (-item, item), writeable=False)
    matrix, constant = np.zeros((size, size)), np.zeros(size)
    for run, first, step in _runs(continued(np.arange(lowest, lowest + width), size, border), size):
        part = unfolded[:, run]
        if first == OUTSIDE:
            constant += part.sum(axis=1)
        elif step:
            last = first + step * (part.shape[1] - 1)
            matrix[:, min(first, last) : max(first, last) + 1] += part[:, ::step]
        else:
            matrix[:, first] += part.sum(axis=1)
    return matrix, constant


def _runs(at: npt.NDArray[np.int64], size: int) -> Iterator[tuple[slice, int, int]]:
    """Stretches of `at` that rise by 1, fall by 1 or stand: where they lie, their first value and their step."""
    apart = np.diff(np.where(at == OUTSIDE, size + 1, at))  # so that what lies outside is nobody's neighbour
    start = 0
    while start < len(at):
        step = int(apart[start]) if start < len(apart) and abs(apart[start]) <= 1 else 1
        others = np.flatnonzero(apart[start:] != step)
        end = start + 1 + (int(others[0]) if len(others) else len(apart) - start)
        yield slice(start, end), int(at[start]), step
        start = end


STRIP, BAND, CHUNK, RUN = 32, 64, 128, 1024  # as in passes.cl and products.cl
MARGIN = 8192
"""Floats of a staged row at most."""


SOURCE = "convolution/passes.cl"


def separable_opencl(
    device: Device,
    image: Image,
    down: Vector,
    across: Vector,
    border: Border,
    value: float,
    tail: Tail | None = None,
) -> Array:
    """The image convolved with `down` along its columns and `across` along its rows; odd lengths, centred. A `tail` is
    for processors, and for kernels of which `rows_laid_out` says that both passes are one."""
    (height, width, channels), radius = (image.height, image.width, image.channels), len(across) // 2
    tall, wide = _folds(down, height, image), _folds(across, width, image)
    out = aligned_empty((height, width, channels), tail.kind if tail else np.float32)
    laid = None if tall or wide or device.in_step else rows_laid_out(len(down), len(across), channels)
    samples = image.coded if laid and isinstance(image, StoredImage) else (image.pixels, None)
    with device.session() as session:
        steps = Steps(session, border, value)
        if laid:
            centred = (down, len(down) // 2), (across, radius)
            both_axes(session, samples, out, centred, laid, border, value, tail=tail)
            return out
        assert tail is None, "no other kernels go on with a chain"
        between = session.scratch(image.pixels.shape)
        if tall:
            steps.multiply(*folded(down, height, border), image.pixels, between)
        elif session.in_step:
            correlate(session, image.pixels, between, Stencil(down[:, np.newaxis], len(down) // 2, 0), border, value)
        elif wide:
            steps.columns(image.pixels, between, 0, down)
        if wide:
            turned, back = (session.scratch((width, height, channels)) for _ in range(2))
            steps.flip(between, turned)
            steps.multiply(*folded(across, width, border), turned, back)
            steps.flip(back, out)
        elif session.in_step:
            correlate(session, between, out, Stencil(across[np.newaxis], 0, radius), border, value * float(down.sum()))
        else:
            # The last load of a row may run over by one segment.
            padded = session.scratch((height, (width + 2 * radius) * channels + 64))
            source, taps = (between, np.ones(1)) if tall else (image.pixels, down)
            steps.columns(source, padded, radius * channels, taps)
            steps.margins(padded, width, channels, radius)
            steps.rows(padded, out, across)
    return out


Laid = tuple[int, int, int]
Placed = tuple[Vector, int]
"""Taps of an axis, and which of them lies over the output sample."""


def rows_laid_out(tall: int, wide: int, channels: int) -> Laid | None:
    """Floats of a tile and of a staged row, and how many rows that were filtered along are kept; None where private
    memory does not hold them."""
    for tile in (WIDE, TILE):
        stride, room = stride_of(wide, channels, tile), STAGE // (tile + 16)
        if stride <= MARGIN and tall - 1 + max(tall // 2, BLOCK) <= room:
            return tile, stride, min(room, max(2 * (tall - 1 + BLOCK), NEAR // (tile + 16)))
    return None


def both_axes(
    session: Session,
    source: tuple[Array, Array | None],
    out: Array,
    taps: tuple[Placed, Placed],
    laid: Laid,
    border: Border,
    value: float,
    bias: float = 0.0,
    *,
    add: bool = False,
    tail: Tail | None = None,
) -> None:
    """Correlation of floats, or of codes and what they mean, down and along in one pass; `add` to what is there."""
    ((down, top), (across, left)), (samples, meant) = taps, source
    (tile, stride, capacity), (height, width, channels) = laid, samples.shape
    tiles = -(-width * channels // tile)
    band = banded(height, tiles, 2 * len(down))
    window = Stencil(np.broadcast_to(1.0, (len(down), len(across))), top, left)
    rows, beside = gathering(samples.shape, window, tile, stride, border)
    then = tail or Tail(SOURCE)
    session.launch(
        then.source, "both", (tiles, -(-height // band)),
        samples, meant, rows, beside, aligned(down), aligned(across), session.readwrite(out), np.int32(height),
        np.int32(width * channels), np.int32(left * channels), np.int32(stride), np.int32(band), np.int32(tile),
        np.int32(channels), np.int32(len(down)), np.int32(len(across)), np.int32(capacity),
        then.numbers, then.counting(session), np.float32(value), np.float32(bias), np.int32(add),
        local=(1, 1), defines={"STAGE": STAGE, "MARGIN": MARGIN, "CODED": int(meant is not None), **then.defines},
    )  # fmt: skip


def separable_numpy(image: Image, down: Vector, across: Vector, border: Border, value: float) -> Array:
    """The same with OpenCV's loops: the image is continued by our borders, of which OpenCV lacks some."""
    import cv2  # slow to load, and no device needs it

    pixels = image.pixels
    for axis, weights in ((0, down), (1, across)):
        lines = np.moveaxis(pixels, axis, 0)
        size, radius = len(lines), len(weights) // 2
        if _folds(weights, size, image):
            matrix, constant = folded(weights, size, border)
            flat = matrix.astype(np.float32) @ lines.reshape(size, -1)
            flat += np.float32(value) * constant.astype(np.float32)[:, None]
            pixels = np.moveaxis(flat.reshape(lines.shape), 0, axis)
        else:
            at = continued(np.arange(-radius, size + radius), size, border)
            padded = np.take(pixels, np.maximum(at, 0), axis)
            np.moveaxis(padded, axis, 0)[at == OUTSIDE] = value
            taps, inside = [np.ones(1), np.ones(1)], [slice(None), slice(None)]
            taps[axis], inside[axis] = weights, slice(radius, radius + size)
            done = cv2.sepFilter2D(padded, -1, taps[1], taps[0], borderType=cv2.BORDER_REPLICATE)
            pixels = done.reshape(padded.shape)[tuple(inside)]
    return aligned(pixels)


def _folds(weights: Vector, size: int, image: Image) -> bool:
    """Whether a pass multiplies by the folded matrix: fewer terms, but its zeros would spread NaN."""
    return len(weights) // 2 >= size or (len(weights) > size and not image.extent.nonfinite)


class Steps:
    """Kernels in a session, taking arrays whose shapes say the rest."""

    def __init__(self, session: Session, border: Border, value: float = 0.0) -> None:
        self.session = session
        self.border = border
        self.value = value

    def multiply(self, matrix: Array, constant: Array | None, source: Array, target: Array) -> None:
        """target = matrix x source over the first axis, plus the border's value times `constant`."""
        count, depth = matrix.shape
        width = source.size // depth
        start = np.zeros(count) if constant is None else self.value * constant
        kernel, grid = ("apart", (width, count)) if self.session.in_step else ("multiply", (-(-width // STRIP),))
        self.session.launch(
            "convolution/products.cl", kernel, grid,
            aligned(matrix.T), source, aligned(start), self.session.write(target),
            np.int32(count), np.int32(depth), np.int32(width), local=None if self.session.in_step else (1,),
        )  # fmt: skip

    def flip(self, source: Array, target: Array) -> None:
        """Rows and columns exchanged."""
        rows, columns, channels = source.shape
        self.session.launch(
            "convolution/products.cl", "flip", (columns, rows),
            source, self.session.write(target), np.int32(rows), np.int32(columns), np.int32(channels),
        )  # fmt: skip

    def columns(self, source: Array, target: Array, offset: int, weights: Vector) -> None:
        """One pass along the first axis into the rows of `target`, from its column `offset` on."""
        height, width, stride = len(source), source.size // len(source), target.size // len(target)
        taps = weights.astype(np.float32)
        for first in range(0, len(taps), CHUNK):
            some = taps[first : first + CHUNK]
            rows = np.arange(height + len(some) - 1) + first - len(taps) // 2
            self.session.launch(
                SOURCE, "columns", (-(-width // STRIP), -(-height // BAND)),
                source, self._sources(rows, height), aligned(some), self.session.readwrite(target), np.int32(height),
                np.int32(width), np.int32(stride), np.int32(offset), np.int32(len(some)), np.float32(self.value),
                np.int32(first > 0), local=(1, 1),
            )  # fmt: skip

    def margins(self, padded: Array, width: int, channels: int, radius: int) -> None:
        """Fill `radius` pixels on both sides of every row."""
        if radius:
            beside = np.concatenate([np.arange(-radius, 0), np.arange(width, width + radius)])
            self.session.launch(
                SOURCE, "margins", (len(padded),),
                self.session.readwrite(padded), self._sources(beside, width), np.int32(len(padded)),
                np.int32(padded.shape[1]), np.int32(radius), np.int32(width), np.int32(channels),
                np.float32(self.value), local=(1,),
            )  # fmt: skip

    def rows(self, padded: Array, target: Array, weights: Vector) -> None:
        """One pass along the padded rows."""
        height, width, channels = target.shape
        self.session.launch(
            SOURCE, "rows", (-(-width * channels // RUN), height),
            padded, aligned(weights), self.session.write(target), np.int32(height), np.int32(width * channels),
            np.int32(padded.shape[1]), np.int32(channels), np.int32(len(weights)),
            local=(1, 1),
        )  # fmt: skip

    def _sources(self, indices: npt.NDArray[np.int64], size: int) -> Array:
        return continued(indices, size, self.border).astype(np.int32)
