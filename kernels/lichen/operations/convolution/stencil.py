"""Correlation with any two-dimensional kernel, tap by tap: what `convolve` and the fixed stencils come down to.

Only taps that are not zero take part, so a NaN reaches exactly the pixels whose kernel holds it. Kernels too large for
one tile of private memory are cut into parts that add up.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Argument, Session
from lichen.operation import ROUNDING, Border, Facts, Footprint
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.stage import Tail

Matrix = npt.NDArray[np.float64]

SOURCE = "convolution/stencil.cl"
TAILED = 15
"""Rows and columns of a stencil that others go on with at most; of larger ones the tail is little of the time."""
STAGE, NEAR, BLOCK = 49152, 24576, 8
"""Floats staged by one work-item at most, as many as it usually stages, and rows computed at once at most. The usual
stage lies in the second cache of a core, which costs less than to move rows up in the first every few rows: 0.9 of the
time for 7 x 7 and 5 x 5 taps, the same for 3 x 3 (two Zen 3 cores)."""
ITEMS, TALLEST, BANDS = 192, 512, 24
"""Items that a picture becomes if it is large enough; rows of each at most; and what their number is a multiple of."""
TILE, WIDE = 256, 512
"""Floats of a tile, where kernels are large and where they are small."""
WIDEST = 1024
"""Floats that a part of the kernel reaches sideways at most."""
BUSY = 49
"""Taps with which summing takes so long that all else is done meanwhile."""
LONGEST = 7
"""Taps of a run at most, as `strips.clh` has it."""
FEW = 49
"""Taps of a part that OpenCV computes directly; more would make it take a transform."""


@dataclass(frozen=True, eq=False)
class Stencil:
    """out[y, x] = sum of taps[i, j] image[y + i - top, x + j - left], plus bias."""

    taps: Matrix
    top: int
    left: int
    bias: float = 0.0

    @property
    def weight(self) -> float:
        """The l1 norm: the largest gain."""
        return float(np.abs(self.taps).sum())

    @property
    def count(self) -> int:
        return int(np.count_nonzero(self.taps))

    def footprint(self, border: Border) -> Footprint:
        tall, wide = self.taps.shape
        rows, columns = max(self.top, tall - 1 - self.top), max(self.left, wide - 1 - self.left)
        return Footprint(max(rows, 0), max(columns, 0), wraps=border is Border.WRAP)

    def range(self, low: float, high: float) -> tuple[float, float]:
        """What the result of values within [low, high] lies within."""
        gain, loss = float(self.taps[self.taps > 0].sum()), float(self.taps[self.taps < 0].sum())
        return gain * low + loss * high + self.bias, gain * high + loss * low + self.bias

    def rounding(self, magnitude: float) -> float:
        """n products added in any order, and the bias: at most n + 2 roundings of what they sum to without signs."""
        whole = self.weight * magnitude + abs(self.bias)
        return 1.01 * (self.count + 3) * ROUNDING * whole

    def parts(self, tall: int, wide: int) -> Iterator[Stencil]:
        """Stencils of at most that many rows and columns that sum to this one; the first carries the bias."""
        bias = self.bias
        for i in range(0, self.taps.shape[0], tall):
            for j in range(0, self.taps.shape[1], wide):
                some = self.taps[i : i + tall, j : j + wide]
                if some.any():
                    yield Stencil(some, self.top - i, self.left - j, bias)
                    bias = 0.0
        if bias == self.bias and not self.taps.any():
            yield Stencil(np.zeros((1, 1)), 0, 0, bias)


def reach_of_values(facts: Facts, border: Border, value: float) -> tuple[float, float]:
    """Lowest and highest value that takes part, with the constant beyond the border."""
    low, high = facts.extent.low, facts.extent.high
    return (min(low, value), max(high, value)) if border is Border.CONSTANT else (low, high)


def correlate_opencl(
    device: Device, image: Image, stencil: Stencil, border: Border, value: float, tail: Tail | None = None
) -> Array:
    out = aligned_empty(image.pixels.shape, tail.kind if tail else np.float32)
    with device.session() as session:
        correlate(session, image.pixels, out, stencil, border, value, tail=tail)
    return out


def correlate(
    session: Session,
    source: Array,
    out: Array,
    stencil: Stencil,
    border: Border,
    value: float,
    *,
    add: bool = False,
    tail: Tail | None = None,
) -> None:
    """Launch the stencil from one array of shape (height, width, channels) to another; `add` to what is there. A `tail`
    is for stencils of `TAILED` taps a side, which are in one part, and for processors."""
    height, width, channels = source.shape
    if session.in_step:
        assert tail is None, "no kernel of these devices goes on with a chain"
        places = np.argwhere(stencil.taps)
        weights = aligned(stencil.taps[tuple(places.T)] if len(places) else np.zeros(1))
        apart(
            session, "correlate", source, out, stencil, border, value,
            aligned(places * (1, channels) if len(places) else np.zeros((1, 2)), np.int32), weights,
            np.int32(len(places)), np.float32(stencil.bias), np.int32(add),
        )  # fmt: skip
        return
    target, floats = session.readwrite(out), width * channels
    wide, then = WIDEST // channels + 1, tail or Tail(SOURCE)
    widest = stride_of(min(wide, stencil.taps.shape[1]), channels)
    tall = STAGE // widest - 2 * BLOCK
    for number, part in enumerate(stencil.parts(tall, wide)):
        rows, columns = part.taps.shape
        busy = part.count >= BUSY
        tile, stride, capacity = laid_out(rows, columns, channels)
        down, beside = gathering(source.shape, part, tile, stride, border)
        runs, weights = _runs(part.taps.astype(np.float64).tobytes(), rows, stride, channels)
        tiles, band = -(-floats // tile), banded(height, -(-floats // tile), rows)
        session.launch(
            then.source, "correlate", (tiles, -(-height // band)),
            source, down, beside, runs, weights,
            target, np.int32(height), np.int32(floats), np.int32(part.left * channels), np.int32(rows),
            np.int32(stride), np.int32(band), np.int32(tile), np.int32(len(runs)), np.float32(value),
            np.float32(part.bias), np.int32(capacity - BLOCK * busy), np.int32(add or number > 0), np.int32(busy),
            then.numbers, then.counting(session),
            local=(1, 1), defines={"STAGE": STAGE, **then.defines},
        )  # fmt: skip


def apart(
    session: Session, kernel: str, source: Array, out: Array, window: Stencil, border: Border, value: float,
    *arguments: Argument,
) -> None:  # fmt: skip
    """Launch a kernel of `apart.cl` over an array of shape (height, width, channels)."""
    height, width, channels = source.shape
    rows, columns = gathering(source.shape, window, 1, (window.taps.shape[1] - 1) * channels, border)
    session.launch(
        "convolution/apart.cl", kernel, (width * channels, height),
        source, rows, columns, session.readwrite(out), np.int32(height), np.int32(width * channels),
        np.int32(channels), np.float32(value), *arguments,
    )  # fmt: skip


def laid_out(rows: int, columns: int, channels: int) -> tuple[int, int, int]:
    """Floats of a tile, floats of its staged rows, and how many of them are staged."""
    for tile in (WIDE, TILE):
        stride = stride_of(columns, channels, tile)
        if (rows - 1 + BLOCK) * stride <= NEAR:
            break
    room = min(STAGE, max(NEAR, 2 * (rows - 1 + BLOCK) * stride)) // stride
    return tile, stride, rows - 1 + (room - rows + 1) // BLOCK * BLOCK


def banded(height: int, tiles: int, rows: int) -> int:
    """Rows of an item: few enough that no processor is idle, and so many that what is staged twice is little; about the
    same for all."""
    wanted = min(max(-(-height * tiles // ITEMS), 4 * rows), TALLEST)
    each = -(-height // -(-height // wanted))
    return -(-each // BANDS) * BANDS


def gathering(shape: tuple[int, ...], part: Stencil, tile: int, stride: int, border: Border) -> tuple[Array, Array]:
    """For kernels that stage tiles: the row that each staged row reads, and the float of it that each float reads."""
    return _gathering(shape, part.taps.shape, part.top, part.left, tile, stride, border)


@lru_cache(16)
def _gathering(
    shape: tuple[int, ...], window: tuple[int, ...], top: int, left: int, tile: int, stride: int, border: Border
) -> tuple[Array, Array]:
    """Kept, since pictures of one size come one after the other: at 2048 x 2048 x 4 it takes 0.4 ms, a kernel 8."""
    height, width, channels = shape
    rows, columns = window
    # What the last tile stages beyond the margin meets no result; the clamp keeps it inside the row.
    at = np.arange(-(-width * channels // tile) * tile + stride) - left * channels
    pixels = continued(np.minimum(at // channels, width - 1 - left + columns), width, border)
    beside = np.where(pixels == OUTSIDE, OUTSIDE, pixels * channels + at % channels)
    down = continued(np.arange(height + rows - 1) - top, height, border)
    return _kept(down.astype(np.int32)), _kept(beside.astype(np.int32))


def _kept(values: Array) -> Array:
    """As kernels read it, and nobody writes it."""
    made = aligned(values, values.dtype)
    made.flags.writeable = False
    return made


def stride_of(columns: int, channels: int, tile: int = TILE) -> int:
    """Floats of a staged row: a tile and what lies beside it."""
    return -(-(tile + (columns - 1) * channels) // 16) * 16


@lru_cache(16)
def _runs(taps: bytes, rows: int, stride: int, channels: int) -> tuple[Array, Array]:
    """Stretches of up to `LONGEST` non-zero taps down each column, (offset into the stage, first weight, count), in
    order of length; and the weights."""
    matrix = np.frombuffer(taps).reshape(rows, -1)
    runs: list[tuple[int, int, int]] = []
    weights: list[float] = []
    for column, line in enumerate(matrix.T):
        inside = np.zeros(rows + 2, np.int8)
        inside[1:-1] = line != 0
        edges = np.flatnonzero(np.diff(inside))
        for start, end in edges.reshape(-1, 2):
            cuts = np.linspace(start, end, -(-(end - start) // LONGEST) + 1).astype(int)
            for first, last in itertools.pairwise(cuts):
                runs.append((first * stride + column * channels, len(weights), last - first))
                weights.extend(line[first:last])
    runs.sort(key=lambda run: run[2])
    return _kept(np.array(runs or [(0, 0, 1)], np.int32)), _kept(np.array(weights or [0.0], np.float32))


def correlate_numpy(image: Image, stencil: Stencil, border: Border, value: float) -> Array:
    """The same with OpenCV's loops, in parts so small that it adds up tap by tap."""
    return aligned(correlated(image.pixels, stencil, border, value))


def correlated(pixels: Array, stencil: Stencil, border: Border, value: float) -> Array:
    """float32, or float64 where `pixels` is that; without a transform."""
    import cv2  # slow to load, and no device needs it

    height, width, _ = pixels.shape
    out = np.full(pixels.shape, stencil.bias, pixels.dtype)
    wide = min(stencil.taps.shape[1], FEW)
    # A part is continued by our borders, of which OpenCV lacks some.
    for part in stencil.parts(max(FEW // wide, 1), wide):
        rows, columns = part.taps.shape
        around = continue_image(
            pixels, (part.top, rows - 1 - part.top), (part.left, columns - 1 - part.left), border, value
        )
        done = cv2.filter2D(around, -1, part.taps, anchor=(0, 0), borderType=cv2.BORDER_REPLICATE)
        out += done.reshape(around.shape)[:height, :width]
    return out


def continue_image(
    pixels: Array, rows: tuple[int, int], columns: tuple[int, int], border: Border, value: float
) -> Array:
    """The image with so many rows before and after it, and columns left and right; negative numbers crop."""
    for axis, (before, after) in enumerate((rows, columns)):
        size = pixels.shape[axis]
        at = continued(np.arange(-before, size + after), size, border)
        pixels = np.take(pixels, np.maximum(at, 0), axis)
        np.moveaxis(pixels, axis, 0)[at == OUTSIDE] = value
    return pixels


def sum_of_taps(pixels: Array, stencil: Stencil, border: Border, value: float) -> Array:
    """The definition: float64, one shifted image for every tap that is not zero."""
    height, width, _ = pixels.shape
    rows, columns = stencil.taps.shape
    around = continue_image(
        pixels.astype(np.float64),
        (stencil.top, rows - 1 - stencil.top),
        (stencil.left, columns - 1 - stencil.left),
        border,
        value,
    )
    out = np.full(pixels.shape, stencil.bias)
    for i, j in np.argwhere(stencil.taps):
        out += stencil.taps[i, j] * around[i : i + height, j : j + width]
    return out


def kept_coverage(image: Image, out: Array) -> Array:
    """`out` with the coverage of `image`, where it has any."""
    if image.alpha is not Alpha.NONE:
        out[..., -1] = image.pixels[..., -1]
    return out
