"""Warps on an OpenCL device: the launches of taps.cl, area.cl and layout.cl, and of the maps' own kernels.

The places of a projective map are nine numbers, and the kernels of the filters find them as they go; those that a
picture gives they read there, and those on rays come of a direction for each column and a radius for each row. Those of
every other map come from its own kernel, one for each operation, which writes them as a table for a band of rows; then
the filter, one for all operations, runs over that band. Tables are also what filters of footprints take of a picture of
places and of rays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Argument, Session
from lichen.operation import Border
from lichen.operations.warp.levels import sizes
from lichen.operations.warp.maps import Map, Projective, Windowed
from lichen.operations.warp.reference import BAND as HELD
from lichen.operations.warp.reference import Closed, Source, grid
from lichen.operations.warp.shown import longest

SEGMENT = 64
"""Pixels that one work-item does; `SEGMENT` in segment.clh."""
GROUP = (1, 16)
ROWS = 16
"""Rows of segments that one work-item of taps.cl does on a processor, one row of samples ahead of what it sums; where
thousands of items run at once, they wait for one another's, and each does one."""
ROUNDED = 1e-5
"""How much longer a half axis may come out in float32 than it is."""
BAND = 1 << 18
"""Pixels whose places are held at once: 12 MiB with their steps."""
BORDERS: list[Border | Closed] = [*Border, *Closed]
"""In the order of their numbers in border.clh and places.clh."""


def built_for(channels: int) -> dict[str, int]:
    """Definitions for kernels over plain pixels: the usual channel counts have their own, others share one."""
    return {"CHANNELS": channels if channels in (1, 3, 4) else 0}


@dataclass(frozen=True, eq=False)
class Band:
    """The places of some rows of a result on the device: nine numbers and the corners of two parts, a picture that
    gives them with its numbers, tables of coordinates and of their steps, or the middle of rays with their table."""

    top: int
    rows: int
    width: int
    matrix: Array | None = None
    table: Array | None = None
    steps: Array | None = None
    given: Array | None = None

    @property
    def grid(self) -> tuple[int, int]:
        return -(-self.width // SEGMENT), self.rows

    @property
    def size(self) -> tuple[np.generic, ...]:
        """Width, first row and rows, as kernels take them."""
        return np.int32(self.width), np.int32(self.top), np.int32(self.rows)


def bands(session: Session, map_: Map, width: int, height: int, *, steps: bool) -> Iterator[Band]:
    """All rows of a map, some at a time so that tables stay in the cache; `steps` where footprints are wanted, too.
    What is launched on one band comes before the next band is filled."""
    recipe, whole = map_.recipe(), map_.of if isinstance(map_, Windowed) else map_
    if isinstance(whole, Projective):
        corners = (*map_.result, *map_.source) if isinstance(map_, Windowed) else (0, 0, 0, 0)
        yield Band(0, height, width, matrix=aligned(np.array([*whole.array.reshape(-1), *corners]), np.float64))
        return
    rays = None if steps else map_.rays(np.arange(width) + 0.5, np.arange(height) + 0.5)
    if rays is not None:
        middle, directions = np.zeros(13), np.stack([rays.cosine, rays.sine], axis=-1)
        middle[:2] = rays.middle
        yield Band(
            0, height, width, matrix=aligned(middle, np.float64),
            table=aligned(np.concatenate([directions.reshape(-1), rays.radius]), np.float64),
        )  # fmt: skip
        return
    if recipe is None:
        yield _by_host(map_, width, height, steps)
        return
    corner = map_.result if isinstance(map_, Windowed) else (0, 0)
    numbers = aligned(np.concatenate([map_.periods, recipe.numbers]), np.float64)
    given = None if recipe.given is None else aligned(recipe.given)
    if recipe.plain and not steps and not any(corner):
        yield Band(0, height, width, matrix=numbers, given=given)
        return
    rows = min(height, max(GROUP[1], BAND // width // GROUP[1] * GROUP[1]))
    table = session.scratch((rows, width, 2), np.float64)
    along = session.scratch((rows, width, 4)) if steps else None
    for top in range(0, height, rows):
        band = Band(top, min(rows, height - top), width, table=table, steps=along)
        session.launch(
            recipe.source, "places", band.grid, numbers, given, session.write(table),
            None if along is None else session.write(along), *(np.int32(n) for n in (width, height, *corner)),
            np.int32(top), np.int32(band.rows), local=GROUP,
        )  # fmt: skip
        yield band


def _by_host(map_: Map, width: int, height: int, steps: bool) -> Band:
    """All rows at once."""
    table = aligned_empty((height, width, 2), np.float64)
    along = aligned_empty((height, width, 4)) if steps else None
    u, rows = np.arange(width) + 0.5, max(1, HELD // width)
    for first in range(0, height, rows):
        some = slice(first, min(first + rows, height))
        v = np.arange(some.start, some.stop) + 0.5
        if along is None:
            table[some, :, 0], table[some, :, 1] = map_.at(u[np.newaxis, :], v[:, np.newaxis])
            continue
        at = map_.places(u, v)
        table[some, :, 0], table[some, :, 1] = at.x, at.y
        with np.errstate(over="ignore"):
            for number, each in enumerate((at.xu, at.yu, at.xv, at.yv)):
                along[some, :, number] = each
    return Band(0, height, width, table=table, steps=along)


@dataclass(frozen=True, eq=False)
class Blocks:
    """An image as kernels read it: pixels of one channel, or of four, in blocks."""

    source: Source
    session: Session

    @property
    def defines(self) -> dict[str, int]:
        return {"CHANNELS": 1 if self.source.pixels.shape[2] == 1 else 4}

    def each(self) -> list[tuple[int, Array]]:
        """The first channel of each block, and its pixels."""
        pixels = self.source.pixels
        height, width, channels = pixels.shape
        if channels in (1, 4):
            return [(0, aligned(pixels))]
        made = []
        image = aligned(pixels)
        for channel in range(0, channels, 4):
            block = self.session.scratch((height, width, 4))
            count = height * width
            self.session.launch(
                "warp/layout.cl", "spread", (-(-count // SEGMENT),), image, self.session.write(block), np.int32(count),
                np.int32(channels), np.int32(channel), local=(16,), defines=self.defines,
            )  # fmt: skip
            made.append((channel, block))
        return made

    @property
    def picture(self) -> tuple[np.generic, ...]:
        """Width, height, border and the value beyond it, as kernels take them."""
        height, width, _ = self.source.pixels.shape
        border = BORDERS.index(self.source.border)
        return np.int32(width), np.int32(height), np.int32(border), np.float32(self.source.value)


def sampled(
    device: Device, source: Source, map_: Map, size: tuple[int, int], kernel: str, *further: np.generic, around: int = 0
) -> Array:
    """The result of one of the kernels of taps.cl, `size` (width, height), of a source with samples put `around` it."""
    width, height = size
    out, own = aligned_empty((height, width, source.pixels.shape[2])), ROWS if device.is_cpu else 1
    with device.session() as session:
        blocks = Blocks(source, session)
        pictures = blocks.each()
        for band in bands(session, map_, width, height, steps=False):
            for channel, pixels in pictures:
                columns, rows = band.grid
                session.launch(
                    "warp/taps.cl", kernel, (columns, -(-rows // own)), band.matrix, band.table, band.given, *band.size,
                    pixels, *blocks.picture, np.int32(around), session.readwrite(out), np.int32(out.shape[2]),
                    np.int32(channel), *further, local=(1, GROUP[1] // own), defines=blocks.defines | {"ROWS": own},
                )  # fmt: skip
    return out


def averaged(
    device: Device, source: Source, map_: Map, size: tuple[int, int], kernel: str, *further: Argument, shallow: float
) -> Array:
    """The result of one of the kernels of area.cl, which takes footprints whose half axes are below `shallow` from the
    image itself: where all are, no pyramid is made, and no mean where none is as large as the image."""
    width, height = size
    axis, sides = max(longest(map_, size), 1.0) * (1 + ROUNDED), source.pixels.shape[:2]
    deep, large = axis >= shallow, axis >= min(sides)
    out = aligned_empty((height, width, source.pixels.shape[2]))
    with device.session() as session:
        blocks = Blocks(source, session)
        each = blocks.each()
        pictures = [(channel, pixels, *_prepared(session, blocks, pixels, deep, large)) for channel, pixels in each]
        for band in bands(session, map_, width, height, steps=True):
            for channel, pixels, levels, described, mean in pictures:
                session.launch(
                    "warp/area.cl", kernel, band.grid, band.matrix, band.table, band.steps, *band.size, pixels,
                    *blocks.picture, session.readwrite(out), np.int32(out.shape[2]), np.int32(channel), levels,
                    described, np.int32(len(described)), mean, *further, local=GROUP, defines=blocks.defines,
                )  # fmt: skip
    return out


def _prepared(session: Session, blocks: Blocks, pixels: Array, deep: bool, large: bool) -> tuple[Array, Array, Array]:
    """The levels of a block, where each lies in them, and its mean; zeros for a mean that nobody takes."""
    levels, described = _pyramid(session, blocks, pixels, deep)
    mean = np.zeros(pixels.shape[2])
    if large:
        mean = _row_sums(session, blocks, pixels).sum(axis=0) / (pixels.shape[0] * pixels.shape[1])
    return levels, aligned(described, np.int32), aligned(mean)


def _row_sums(session: Session, blocks: Blocks, pixels: Array) -> Array:
    """Sums of all rows, float64 (rows, channels); waits for them."""
    height, width, channels = pixels.shape
    sums = session.scratch((height, channels), np.float64)
    session.launch(
        "warp/layout.cl", "sum_rows", (height,), pixels, session.write(sums), np.int32(width), np.int32(height),
        local=(16,), defines=blocks.defines,
    )  # fmt: skip
    session.finish()
    return sums


def _pyramid(session: Session, blocks: Blocks, pixels: Array, deep: bool) -> tuple[Array, Array]:
    """All levels but the first one after another, and where each starts, its width and height."""
    height, width, _ = pixels.shape
    each = sizes(height, width) if deep else [(height, width)]
    described, start = [(0, width, height)], 0
    for tall, wide in each[1:]:
        described.append((start, wide, tall))
        start += tall * wide
    levels = session.scratch((max(start, 1), pixels.shape[2]))
    if start == 0:
        levels[...] = 0
    held = session.readwrite(levels)
    _, _, border, value = blocks.picture
    for number in range(1, len(each)):
        (tall, wide), (half_tall, half_wide) = each[number - 1], each[number]
        session.launch(
            "warp/layout.cl", "halve", (-(-half_wide // SEGMENT), half_tall), pixels if number == 1 else None, held,
            np.int32(described[number - 1][0]), np.int32(described[number][0]), np.int32(wide), np.int32(tall), border,
            value, local=GROUP, defines=blocks.defines,
        )  # fmt: skip
    return levels, np.array(described)


def samples_of(count: int) -> tuple[Array, np.generic]:
    """The grid of supersampling as its kernel takes it."""
    return aligned(np.array(grid(count)).reshape(-1)), np.int32(count * count)
