"""Warps on an OpenCL device: the launches of taps.cl, area.cl and layout.cl."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Argument, Session
from lichen.operation import Border
from lichen.operations.warp.levels import sizes
from lichen.operations.warp.maps import Map, Projective, Windowed
from lichen.operations.warp.reference import BAND, Closed, Source, grid

SEGMENT = 64
"""Pixels that one work-item does; `SEGMENT` in places.clh."""
GROUP = (1, 16)
BORDERS: list[Border | Closed] = [*Border, *Closed]
"""In the order of their numbers in border.clh and places.clh."""


def built_for(channels: int) -> dict[str, int]:
    """Definitions for kernels over plain pixels: the usual channel counts have their own, others share one."""
    return {"CHANNELS": channels if channels in (1, 3, 4) else 0}


@dataclass(frozen=True, eq=False)
class Looks:
    """The places of a result on the device: nine numbers and the corners of two parts, or tables of coordinates and of
    their steps."""

    matrix: Array | None
    table: Array | None
    steps: Array | None
    width: int
    height: int

    @classmethod
    def of(cls, map_: Map, width: int, height: int, *, steps: bool) -> Looks:
        """Of a map; `steps` where footprints are wanted, too."""
        whole = map_.of if isinstance(map_, Windowed) else map_
        if isinstance(whole, Projective):
            corners = (*map_.result, *map_.source) if isinstance(map_, Windowed) else (0, 0, 0, 0)
            return cls(aligned(np.array([*whole.matrix, *corners]), np.float64), None, None, width, height)
        table = aligned_empty((height, width, 2), np.float64)
        along = aligned_empty((height, width, 4)) if steps else None
        u, rows = np.arange(width) + 0.5, max(1, BAND // width)
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
        return cls(None, table, along, width, height)

    @property
    def grid(self) -> tuple[int, int]:
        return -(-self.width // SEGMENT), self.height


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
    device: Device, source: Source, map_: Map, size: tuple[int, int], kernel: str, *further: np.generic
) -> Array:
    """The result of one of the kernels of taps.cl, `size` (width, height)."""
    looks = Looks.of(map_, *size, steps=False)
    out = aligned_empty((looks.height, looks.width, source.pixels.shape[2]))
    with device.session() as session:
        blocks = Blocks(source, session)
        for channel, pixels in blocks.each():
            session.launch(
                "warp/taps.cl", kernel, looks.grid, looks.matrix, looks.table, np.int32(looks.width),
                np.int32(looks.height), pixels, *blocks.picture, session.readwrite(out), np.int32(out.shape[2]),
                np.int32(channel), *further, local=GROUP, defines=blocks.defines,
            )  # fmt: skip
    return out


def averaged(
    device: Device, source: Source, map_: Map, size: tuple[int, int], kernel: str, *further: Argument, deep: bool = True
) -> Array:
    """The result of one of the kernels of area.cl; `deep` where it needs a pyramid."""
    looks = Looks.of(map_, *size, steps=True)
    channels = source.pixels.shape[2]
    out = aligned_empty((looks.height, looks.width, channels))
    with device.session() as session:
        blocks = Blocks(source, session)
        for channel, pixels in blocks.each():
            levels, described = _pyramid(session, blocks, pixels, deep)
            mean = aligned(_row_sums(session, blocks, pixels).sum(axis=0) / (pixels.shape[0] * pixels.shape[1]))
            session.launch(
                "warp/area.cl", kernel, looks.grid, looks.matrix, looks.table, looks.steps, np.int32(looks.width),
                np.int32(looks.height), pixels, *blocks.picture, session.readwrite(out), np.int32(channels),
                np.int32(channel), levels, aligned(described, np.int32), np.int32(len(described)),
                mean, *further, local=GROUP, defines=blocks.defines,
            )  # fmt: skip
    return out


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
