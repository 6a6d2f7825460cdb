"""Images that are read and written in parts: TIFF, OpenEXR and Zarr version 3.

A TIFF says what its numbers mean as every TIFF does: integers are display-referred, floats linear, an extra sample may
be coverage. A Zarr array of shape (height, width) or (height, width, channels) says so in its attributes `space` and
`alpha`; without them it is data.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lichen.errors import Flaw, InvalidRequest, UnsupportedFormat
from lichen.image import Alpha, Space, Storage
from lichen.memory import Array
from lichen_batch import exr

TIFF_TILE = 256
"""Pixels; side of the tiles of a TIFF."""
PIECE = 1024
"""Pixels; side of what is read at a time where chunks are smaller."""
LARGE_TIFF = 1 << 31
"""Bytes from which a TIFF needs 64-bit offsets, with room for what is not pixels."""


@dataclass(frozen=True)
class Raster:
    """An image on disk of which any part can be read."""

    array: Any
    """a Zarr array"""
    space: Space
    alpha: Alpha
    storage: Storage

    @property
    def shape(self) -> tuple[int, int, int]:
        shape = tuple(self.array.shape)
        return (*shape, 1) if len(shape) == 2 else shape

    def read(self, top: int, left: int, height: int, width: int) -> Array:
        """A part as it is stored, of three dimensions.

        Zarr holds all chunks that it reads at once; so it is asked for few at a time.
        """
        chunks = getattr(self.array, "chunks", None)
        if chunks is None:
            part = np.asarray(self.array[top : top + height, left : left + width])
        else:
            part = np.empty((height, width, *self.array.shape[2:]), self.array.dtype)
            for rows in _steps(top, height, chunks[0]):
                for columns in _steps(left, width, chunks[1]):
                    y, x = (slice(at.start - begin, at.stop - begin) for at, begin in ((rows, top), (columns, left)))
                    part[y, x] = self.array[rows, columns]
        return part if part.ndim == 3 else part[:, :, np.newaxis]


def _steps(start: int, length: int, chunk: int) -> Iterator[slice]:
    """A range in pieces that end where chunks do: single chunks, or as many as make up `PIECE`."""
    step = chunk * max(1, PIECE // chunk)
    at, end = start, start + length
    while at < end:
        following = min((at // step + 1) * step, end)
        yield slice(at, following)
        at = following


def is_tiff(path: str) -> bool:
    return Path(path).suffix.lower() in (".tif", ".tiff")


def is_exr(path: str) -> bool:
    return Path(path).suffix.lower() == ".exr"


def in_bands(path: str) -> bool:
    """Whether a file of this name is written from top to bottom, rather than tile by tile in any order."""
    return is_tiff(path) or is_exr(path)


def open_raster(path: str, *, space: Space | None = None) -> Raster:
    """Raises `UnsupportedFormat` for what is neither, OSError where nothing is there."""
    if not Path(path).exists():
        raise FileNotFoundError(2, "No such file or directory", path)
    if is_exr(path):
        parts = exr.Parts(path)
        return Raster(parts, space or parts.header.space, parts.header.alpha, parts.header.storage)
    return _open_tiff(path, space) if is_tiff(path) else _open_zarr(path, space)


def _open_tiff(path: str, space: Space | None) -> Raster:
    import tifffile
    import zarr

    series = tifffile.TiffFile(path).series[0]
    page = series.keyframe
    array = zarr.open_array(series.aszarr(level=0), mode="r")
    storage = _storage_of(np.dtype(array.dtype), path)
    picture = page.photometric == tifffile.PHOTOMETRIC.RGB or page.samplesperpixel == 1
    extra = [int(each) for each in page.extrasamples]
    alpha = {1: Alpha.ASSOCIATED, 2: Alpha.STRAIGHT}.get(extra[-1] if extra else 0, Alpha.NONE)
    natural = (Space.SRGB if storage.integer else Space.LINEAR) if picture or alpha is not Alpha.NONE else Space.DATA
    if len(array.shape) == 3 and page.planarconfig == tifffile.PLANARCONFIG.SEPARATE:
        raise UnsupportedFormat(f"{path} holds its channels one after the other; they are read interleaved.")
    return Raster(array, space or natural, alpha, storage)


def _open_zarr(path: str, space: Space | None) -> Raster:
    import zarr

    try:
        array = zarr.open_array(path, mode="r")
    except Exception as wrong:  # Zarr's errors are as many as its stores
        why = "" if os.path.isfile(path) else f" ({wrong})"
        raise UnsupportedFormat(f"{path} is none of TIFF, OpenEXR and Zarr, from which tiles are read{why}.") from None
    if len(array.shape) not in (2, 3):
        raise UnsupportedFormat(f"{path} has {len(array.shape)} dimensions; an image has (height, width[, channels]).")
    said: dict[str, Any] = dict(array.attrs)
    kind = Space(said["space"]) if said.get("space") in list(Space) else Space.DATA
    alpha = Alpha(said["alpha"]) if said.get("alpha") in list(Alpha) else Alpha.NONE
    return Raster(array, space or kind, alpha, _storage_of(np.dtype(array.dtype), path))


def _storage_of(kind: np.dtype[Any], path: str) -> Storage:
    try:
        return Storage(kind.newbyteorder("=").name)
    except ValueError:
        raise UnsupportedFormat(f"{path} holds {kind.name}, which no image here is stored in.") from None


@contextmanager
def zarr_target(path: str, shape: tuple[int, int, int], tile: tuple[int, int], raster: Raster) -> Iterator[Any]:
    """A new Zarr array (version 3) to be filled tile by tile, in its place when the body ends without an error.

    `raster` says what it will hold; its array is not looked at.
    """
    import zarr

    part = f"{path.rstrip('/')}.lichen-part"
    shutil.rmtree(part, ignore_errors=True)
    attributes: dict[str, Any] = {"space": str(raster.space), "alpha": str(raster.alpha)}
    try:
        yield zarr.create_array(
            part,
            shape=shape,
            chunks=(*tile, shape[2]),
            dtype=raster.storage.value,
            zarr_format=3,
            attributes=attributes,
        )
        if Path(path).is_dir():
            shutil.rmtree(path)
        Path(part).rename(path)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def write_bands(path: str, shape: tuple[int, int, int], raster: Raster, bands: Iterator[Array]) -> None:
    """A tiled file of the format that its suffix names, from bands of its rows whose heights are multiples of the side
    of its tiles but for the last."""
    if is_exr(path):
        exr.write(path, shape, raster.space, raster.alpha, raster.storage, bands)
    else:
        write_tiff(path, shape, raster, bands)


def write_tiff(path: str, shape: tuple[int, int, int], raster: Raster, bands: Iterator[Array]) -> None:
    """A tiled TIFF, from bands of its rows whose heights are multiples of `TIFF_TILE` but for the last."""
    import tifffile

    picture = raster.space is not Space.DATA and shape[2] - (raster.alpha is not Alpha.NONE) >= 3
    natural = Space.SRGB if raster.storage.integer else Space.LINEAR
    if raster.space not in (natural, Space.DATA):
        raise InvalidRequest(
            "A TIFF in tiles holds integers as sRGB and floats as linear light.", [Flaw("/space", f"is {raster.space}")]
        )
    extra = ["unspecified"] * (shape[2] - (raster.alpha is not Alpha.NONE) - (3 if picture else 1))
    if raster.alpha is not Alpha.NONE:
        extra.append("assocalpha" if raster.alpha is Alpha.ASSOCIATED else "unassalpha")
    size = int(np.prod(shape, dtype=np.int64)) * np.dtype(raster.storage.value).itemsize
    part = Path(f"{path}.lichen-part")
    try:
        with tifffile.TiffWriter(part, bigtiff=size > LARGE_TIFF) as writer:
            writer.write(
                _tiles(bands, shape),
                shape=shape if shape[2] > 1 else shape[:2],
                dtype=raster.storage.value,
                tile=(TIFF_TILE, TIFF_TILE),
                photometric="rgb" if picture else "minisblack",
                planarconfig="contig" if shape[2] > 1 else None,
                extrasamples=extra or None,
                software=False,
                metadata=None,
            )
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _tiles(bands: Iterator[Array], shape: tuple[int, int, int]) -> Iterator[Array]:
    for band in bands:
        for top in range(0, band.shape[0], TIFF_TILE):
            for left in range(0, shape[1], TIFF_TILE):
                tile = band[top : top + TIFF_TILE, left : left + TIFF_TILE]
                whole = np.zeros((TIFF_TILE, TIFF_TILE, shape[2]), band.dtype)
                whole[: tile.shape[0], : tile.shape[1]] = tile
                yield whole if shape[2] > 1 else whole[:, :, 0]
