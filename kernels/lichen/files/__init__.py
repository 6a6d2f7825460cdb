"""Encoded bytes to `Image` and back, in memory only.

    decode: recognise -> read the header ourselves -> check limits -> decode -> turn upright -> scale to floats
    encode: choose a storage -> check that the format can say what the image is -> quantise -> write

The rules every format keeps:

* Nothing a header claims is believed before it is checked against `Limits`, and no decoder sees the bytes before that.
* A damaged or incomplete file is an error, never half an image. Only `LichenError`s come out.
* Space: PNG, JPEG, WebP and integer TIFF hold sRGB, EXR and float TIFF linear light, NPY data, unless the file says
  otherwise in a way that is understood. What is not understood is carried along, and `metadata["colour_note"]` says so.
* Encoding never converts colour or association: the image must already be what the format holds. A picture in another
  space is tagged as what it is.
* Metadata carried: `icc` (bytes), `channel_names` and `exr_attributes` (EXR), `colour_note`. EXIF is left behind
  after its orientation has been applied: it holds places and names that a caller may not mean to pass on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import PurePath
from typing import Any

from lichen.errors import UnreadableImage, UnsupportedFormat, nearest
from lichen.files.exr import exr
from lichen.files.format import Data, Encoded, Format, Header, Limits
from lichen.files.jpeg import jpeg
from lichen.files.netcdf import netcdf
from lichen.files.npy import npy
from lichen.files.png import png
from lichen.files.samples import extent_of, to_floats, to_storage, upright
from lichen.files.tiff import tiff
from lichen.files.vti import vti
from lichen.files.webp import webp
from lichen.image import Codes, Image, Storage, StoredImage
from lichen.memory import Array, aligned

__all__ = [
    "FORMATS",
    "READABLE",
    "Data",
    "Encoded",
    "Format",
    "Header",
    "Limits",
    "assembled",
    "decode",
    "encode",
    "format_for_media_type",
    "format_for_path",
    "probe",
    "recognise",
]

FORMATS: Mapping[str, Format] = {format.name: format for format in (png, jpeg, webp, tiff, exr, npy)}
"""What is read and written, by name."""
READABLE: Mapping[str, Format] = {**FORMATS, **{format.name: format for format in (netcdf, vti)}}
"""What is read, by name."""
Widen = Callable[[Array], Array]
"""Stored samples to floats, as `to_floats` does it."""
Quantise = Callable[[Array, Storage], tuple[Array, int, int]]
"""Floats to stored samples, as `to_storage` does it."""
_ANYTHING = ("application/octet-stream", "binary/octet-stream", "image/*", "*/*", "")


def probe(data: Data, *, media_type: str | None = None, select: str = "") -> Header:
    """The header of an encoded image; no pixel is decoded and no limit checked. `select` says which part of a file of
    data is meant (`lichen.files.selection`); its samples are read with the header.

    Raises `UnsupportedFormat` for bytes of no known format, `UnreadableImage` where the header is damaged or
    `media_type` names another format than the bytes have, and `TooLarge` for a profile that inflates too far.
    """
    format = recognise(data, media_type=media_type)
    return format.header(memoryview(data).cast("B"), select)


def decode(
    data: Data,
    *,
    limits: Limits | None = None,
    media_type: str | None = None,
    select: str = "",
    widen: Widen = to_floats,
) -> Image:
    """The first picture of an encoded image, upright, float32 (float64 where doubles were stored); of a file of data
    what `select` says (`lichen.files.selection`).

    Raises as `probe` does, and `TooLarge` where the header crosses `limits` (None: `Limits()`).
    """
    view = memoryview(data).cast("B")
    format = recognise(view, media_type=media_type)
    header = format.header(view, select)
    header.check(limits or Limits())
    return assembled(header, format.samples(view, header), widen)


def assembled(header: Header, samples: Array, widen: Widen = to_floats) -> Image:
    """The image that a header describes, of samples as they are stored. Raises `UnreadableImage` where they differ."""
    if samples.shape != header.stored_shape:
        raise UnreadableImage(f"The {header.format} header claims {header.stored_shape}, the data {samples.shape}.")
    shown = upright(samples, header.orientation)
    known: Any = {
        "space": header.space, "alpha": header.alpha, "storage": header.storage, "metadata": header.metadata
    }  # fmt: skip
    if (extent := extent_of(samples)) is None:
        return Image(widen(shown), **known)
    image = StoredImage(Codes(aligned(shown, shown.dtype), widen), **known)
    vars(image)["extent"] = extent  # measured where there are fewer bytes
    return image


def encode(
    image: Image,
    format: str,
    *,
    storage: Storage | None = None,
    quality: int | None = None,
    quantise: Quantise = to_storage,
) -> Encoded:
    """The bytes of a file, its media type, and how many samples its storage could not hold.

    `format` is a name in `FORMATS`. `storage` None means the image's own where the format has it, else the nearest
    richer one (PNG: 16 bits for all but 8-bit images), else the nearest poorer. `quality` is 0 to 100 for JPEG (None:
    90) and WebP (None: lossless).

    Raises `UnsupportedFormat` for an unknown format, or a storage, size or number of channels it cannot hold;
    `InvalidRequest` for a bad quality, or alpha of the kind the format does not hold.
    """
    if format not in FORMATS:
        raise UnsupportedFormat(f"There is no format {format!r}; {nearest(format, FORMATS)}")
    target = FORMATS[format]
    storage = storage or target.storage_for(image.storage)
    target.check(image, storage, quality)
    if isinstance(image, StoredImage) and image.codes.table is None and image.codes.samples.dtype == storage.value:
        samples, (clipped, nonfinite) = image.codes.samples, image.codes.moved
    else:
        samples, clipped, nonfinite = quantise(image.pixels, storage)
    return Encoded(target.write(samples, image, quality), target.media_type, clipped, nonfinite)


def recognise(data: Data, *, media_type: str | None = None) -> Format:
    """The format of the bytes, by their beginning; a media type that says otherwise is an error."""
    head = bytes(memoryview(data).cast("B")[:16])
    if not head:
        raise UnreadableImage("There are no bytes to decode.")
    found = next((format for format in READABLE.values() if format.recognises(head)), None)
    named = None if _bare(media_type) in _ANYTHING else format_for_media_type(media_type or "")
    if found is None:
        claim = f" although they are called {named.media_type}" if named else ""
        raise UnsupportedFormat(f"The bytes do not begin like {' or '.join(READABLE)}{claim}.")
    if named is not None and named is not found:
        raise UnreadableImage(f"The bytes are called {named.media_type} but begin like {found.media_type}.")
    return found


def format_for_media_type(media_type: str) -> Format:
    """The format a media type names, parameters ignored. Raises `UnsupportedFormat`."""
    bare = _bare(media_type)
    for format in READABLE.values():
        if bare in format.media_types:
            return format
    known = ", ".join(format.media_type for format in READABLE.values())
    raise UnsupportedFormat(f"The media type {bare[:80]!r} is not supported; known: {known}.")


def format_for_path(path: str | PurePath) -> Format:
    """The format a file name's ending stands for. Raises `UnsupportedFormat`."""
    suffix = PurePath(path).suffix.lower()
    for format in READABLE.values():
        if suffix in format.extensions:
            return format
    known = {extension: format.name for format in READABLE.values() for extension in format.extensions}
    raise UnsupportedFormat(f"The ending {suffix!r} stands for no supported format; {nearest(suffix, known)}")


def _bare(media_type: str | None) -> str:
    return (media_type or "").partition(";")[0].strip().lower()
