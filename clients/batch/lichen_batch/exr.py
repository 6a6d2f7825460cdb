"""OpenEXR in parts: any rectangle of a file read, whether it lies in tiles or in lines, and tiled files written.

What channels mean, and their order, is decided where whole files are read (`lichen.files.exr`), so a picture in parts
is the same picture. Tiles and lines come through OpenImageIO, a file opened for each part: parts are read by several
threads, and by other processes.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lichen.errors import Flaw, InvalidRequest, UnreadableImage
from lichen.files import probe
from lichen.image import Alpha, Space, Storage
from lichen.memory import Array

TILE = 256
"""Pixels; side of the tiles of a file that is written."""
_NAMED = {Space.LINEAR: "lin_rec709_scene", Space.DATA: "data"}


class Parts:
    """The pixels of a file, of which any rectangle can be asked for; stands where a Zarr array would."""

    def __init__(self, path: str) -> None:
        """Raises what reading the whole file's header would."""
        self.path = path
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            self.header = probe(memoryview(bytes(content[: 1 << 20])))
        self.shape = (self.header.height, self.header.width, self.header.channels)
        self.dtype = np.dtype(self.header.storage.value)

    def __getitem__(self, part: tuple[slice, slice]) -> Array:
        rows, columns = (each.indices(length) for each, length in zip(part, self.shape, strict=False))
        return self._read(rows[0], rows[1], columns[0], columns[1])

    def _read(self, top: int, bottom: int, left: int, right: int) -> Array:
        import OpenImageIO as oiio

        file = oiio.ImageInput.open(self.path)
        if file is None:
            raise UnreadableImage(f"{self.path} cannot be read: {oiio.geterror()}")
        try:
            spec = file.spec()
            kind = "half" if self.dtype == np.float16 else "float"
            x, y = spec.x, spec.y
            if spec.tile_width:
                # Whole tiles, as far as the picture goes.
                first, above = left // spec.tile_width * spec.tile_width, top // spec.tile_height * spec.tile_height
                last = min(-(-right // spec.tile_width) * spec.tile_width, spec.width)
                below = min(-(-bottom // spec.tile_height) * spec.tile_height, spec.height)
                span = (x + first, x + last, y + above, y + below, 0, 1)
                found = file.read_tiles(0, 0, *span, 0, spec.nchannels, kind)
            else:
                first, above, last, below = 0, top, spec.width, bottom
                found = file.read_scanlines(0, 0, y + top, y + bottom, 0, 0, spec.nchannels, kind)
            if found is None:
                raise UnreadableImage(f"{self.path} cannot be read: {file.geterror()}")
            whole = np.asarray(found).reshape(below - above, last - first, spec.nchannels)
            places = {name: at for at, name in enumerate(spec.channelnames)}
            order = [places[name] for name in self.header.details]
            return whole[top - above : bottom - above, left - first : right - first, order]
        finally:
            file.close()


def write(
    path: str, shape: tuple[int, int, int], space: Space, alpha: Alpha, storage: Storage, bands: Iterator[Array]
) -> None:
    """A tiled file, from bands of its rows whose heights are multiples of `TILE` but for the last.

    Raises `InvalidRequest` for what EXR does not hold: whole numbers, display values and straight coverage.
    """
    import OpenImageIO as oiio

    flaws = []
    if storage not in (Storage.FLOAT16, Storage.FLOAT32):
        flaws.append(Flaw("/storage", f"is {storage}; EXR holds float16 and float32"))
    if space not in _NAMED:
        flaws.append(Flaw("/space", f"is {space}; EXR in tiles holds linear light and data"))
    if alpha is Alpha.STRAIGHT:
        flaws.append(Flaw("/alpha", "is straight; EXR holds associated coverage"))
    if flaws:
        raise InvalidRequest("An EXR in tiles cannot hold this.", flaws)
    part = Path(path).with_name(f".{Path(path).name}.lichen-part.exr")
    spec = oiio.ImageSpec(shape[1], shape[0], shape[2], "half" if storage is Storage.FLOAT16 else "float")
    spec.tile_width = spec.tile_height = TILE
    spec.channelnames = _names(shape[2], space, alpha)
    spec.alpha_channel = shape[2] - 1 if alpha is not Alpha.NONE else -1
    spec.attribute("compression", "zip")
    spec.attribute("colorInteropID", _NAMED[space])
    # The library would write the time of day: the same picture is the same file.
    spec.attribute("DateTime", "1970:01:01 00:00:00")
    file = oiio.ImageOutput.create(str(part))
    try:
        if file is None or not file.open(str(part), spec):
            raise OSError(f"{path} cannot be written: {oiio.geterror() if file is None else file.geterror()}")
        top = 0
        for band in bands:
            bottom = top + band.shape[0]
            # A copy: what came from another process names its order of bytes, and the library knows no such type.
            if not file.write_tiles(0, shape[1], top, bottom, 0, 1, np.array(band, order="C")):
                raise OSError(f"{path} cannot be written: {file.geterror()}")
            top = bottom
        if not file.close():
            raise OSError(f"{path} cannot be written: {file.geterror()}")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _names(channels: int, space: Space, alpha: Alpha) -> tuple[Any, ...]:
    """Names that stand for channels of this number and meaning, in an order that reading keeps."""
    coverage = ("A",) if alpha is not Alpha.NONE else ()
    rest = channels - len(coverage)
    colour = ("R", "G", "B") if rest >= 3 else ("Y",)
    if space is Space.DATA and rest != 3:
        return tuple(f"channel{at:03}" for at in range(channels))
    further = tuple(f"channel{at:03}" for at in range(rest - len(colour)))
    return (*colour, *further, *coverage)
