"""Recursive filters run along the lines of an image, with the borders that every other method has.

Each state of a filter (see `recursive_filters`) starts as the sum that it would be had it run from infinity over the
image continued by its border: c[-1] = sum of p^k x[-1 - k]. As every sample out there is one of the line, or the
constant, that is a sum over the line with weights that follow from the border alone. Nothing is assumed to be flat and
nothing is computed beyond the image, so a filter is as accurate at an edge as in the middle.

With OpenCL, lines run side by side in vectors and come out transposed: two passes bring an image back as it was. NumPy
has no loop for a recursion: there a block of `BLOCK` samples is a product with the matrix of the response plus what the
two states at its ends contribute, and only those states recur, from block to block.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.recursive_filters import Filter

BLOCK, LANES = 32, 16
"""Samples of a block with NumPy; floats that run side by side with OpenCL, as in lines.cl."""
ITEMS = 64
"""Work-items of a pass: enough for every processor, and so few that what they keep of their lines is little memory.
With an item for every line, four pictures of 12 megapixels at once take two to three times as long, since the system
has to be asked for so much memory."""


@lru_cache(maxsize=64)
def start(filtered: Filter, size: int, border: Border, first: int, step: int) -> tuple[Array, Array]:
    """Samples, and for each its weights (count, 2 x poles), real and imaginary, of the states beside sample `first`.

    The state is the sum of p^k x[first + k step] over k >= 0, `first` being the first sample that lies outside.
    OUTSIDE is the constant. Small weights come first, so that sums round little.
    """
    distances = np.arange(filtered.reach)
    at = continued(first + step * distances, size, border)
    powers = np.power.outer(filtered.poles, distances)
    gathered = np.array([np.bincount(at - OUTSIDE, part) for power in powers for part in (power.real, power.imag)]).T
    largest = np.abs(gathered).max(axis=1)
    order = np.argsort(largest, kind="stable")
    order = order[largest[order] > 0]
    return (order + OUTSIDE).astype(np.int32), gathered[order]


@dataclass(frozen=True, eq=False)
class Pass:
    """What lines.cl is told of one axis: samples of a line lie `step` rows of the matrix apart."""

    source: Array
    target: Array
    size: int
    step: int
    lanes: int
    items: int

    @property
    def numbers(self) -> tuple[np.int32, ...]:
        """rows, width, in_stride, out_stride, step and items of the kernels."""
        rows, stride, turned = self.size * self.step, self.source.shape[-1], self.target.shape[-1]
        return tuple(np.int32(each) for each in (rows, self.lanes, stride, turned, self.step, self.items))

    @property
    def floats(self) -> int:
        """Of the lines that items are at."""
        return self.items * LANES * self.size * self.step


def both_passes(session: Session, pixels: Array, out: Array) -> tuple[Pass, Pass]:
    """Down the image into a transposed one between, and along its rows into `out`; shapes (height, width, channels)."""
    height, width, channels = pixels.shape
    floats = width * channels
    down, across = (-(-lanes // LANES) for lanes in (floats, height))
    if not session.in_step:
        down, across = min(down, ITEMS), min(across, ITEMS)
    between = session.scratch((floats, -(-height // LANES) * LANES))
    flat, done = pixels.reshape(height, floats), out.reshape(height, floats)
    return Pass(flat, between, height, 1, floats, down), Pass(between, done, width, channels, height, across)


def recursive_opencl(
    device: Device, pixels: Array, down: Filter, across: Filter, border: Border, value: float
) -> Array:
    """`pixels` (height, width, channels) filtered along columns by `down` and along rows by `across`."""
    out = aligned_empty(pixels.shape)
    with device.session() as session:
        passes = both_passes(session, pixels, out)
        sums = session.scratch((max(each.floats for each in passes),))
        for filtered, each in zip((down, across), passes, strict=True):
            before, before_weights = start(filtered, each.size, border, -1, -1)
            after, after_weights = start(filtered, each.size, border, each.size, 1)
            session.launch(
                "convolution/lines.cl", "recurse", (each.items,),
                each.source, aligned(before, np.int32), aligned(before_weights), aligned(after, np.int32),
                aligned(after_weights), _constants(filtered),
                session.readwrite(sums), session.readwrite(each.target),
                *each.numbers, np.int32(len(before)), np.int32(len(after)), np.float32(value), local=(1,),
                defines={"PAIRS": len(filtered.poles)},
            )  # fmt: skip
    return out


def _constants(filtered: Filter) -> Array:
    """For each pole p of weight a: p, a and a p, real and imaginary."""
    parts = np.stack([filtered.poles, filtered.weights, filtered.weights * filtered.poles], axis=1)
    return aligned(np.stack([parts.real, parts.imag], axis=2))


def recursive_numpy(pixels: Array, down: Filter, across: Filter, border: Border, value: float) -> Array:
    """The same by blocks."""
    for axis, filtered in ((0, down), (1, across)):
        lines = np.moveaxis(pixels, axis, 0)
        done = _along(lines.reshape(len(lines), -1), filtered, border, value)
        pixels = np.moveaxis(done.reshape(lines.shape), 0, axis)
    return aligned(pixels)


def _along(lines: Array, filtered: Filter, border: Border, value: float) -> Array:
    """Lines along the first axis of (size, count)."""
    size, count = lines.shape
    blocks = -(-size // BLOCK)
    end = blocks * BLOCK
    x = np.empty((end, count), np.float32)
    x[:size] = lines
    more = continued(np.arange(size, end), size, border)
    x[size:] = np.where((more == OUTSIDE)[:, None], np.float32(value), lines[np.maximum(more, 0)])
    x = x.reshape(blocks, BLOCK, count)
    poles, weights = filtered.poles, filtered.weights
    powers = poles[:, None] ** np.arange(BLOCK + 1)
    # What a block adds to the states behind its last sample, from before, and at its first, from behind.
    gathered = _real(np.concatenate([powers[:, BLOCK - 1 :: -1], powers[:, :BLOCK]])) @ x
    forward, backward = np.split(gathered[:, ::2] + 1j * gathered[:, 1::2], 2, axis=1)
    # Real and imaginary parts lie one after the other, in whole planes: a product of strided ones is not BLAS's.
    states = np.empty((2, blocks, 2 * len(poles), count), np.float32)
    ahead, behind = (_state(filtered, lines, border, value, *at) for at in ((-1, -1), (end, 1)))
    for block in range(blocks):
        states[:, block, : len(poles)] = ahead.real, ahead.imag
        ahead = powers[:, BLOCK:] * ahead + forward[block]
        states[:, -1 - block, len(poles) :] = behind.real, behind.imag
        behind = powers[:, BLOCK:] * behind + backward[-1 - block]
    apart = np.abs(np.subtract.outer(np.arange(BLOCK), np.arange(BLOCK)))
    out = filtered.response(BLOCK)[apart].astype(np.float32) @ x
    back = (weights[:, None] * powers[:, 1:]).T
    shares = np.concatenate([back, back[::-1]], axis=1)
    out += shares.real.astype(np.float32) @ states[0]
    out -= shares.imag.astype(np.float32) @ states[1]
    done: Array = out.reshape(end, count)[:size]
    return done


def _real(rows: Array) -> Array:
    """Real and imaginary parts in turn."""
    return np.stack([rows.real, rows.imag], axis=1).reshape(2 * len(rows), -1).astype(np.float32)


def _state(filtered: Filter, lines: Array, border: Border, value: float, first: int, step: int) -> Array:
    at, weights = start(filtered, len(lines), border, first, step)
    samples = np.where((at == OUTSIDE)[:, None], np.float32(value), lines[np.maximum(at, 0)])
    parts = weights.T @ samples
    return np.asarray(parts[::2] + 1j * parts[1::2])
