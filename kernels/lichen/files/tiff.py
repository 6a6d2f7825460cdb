"""TIFF: 8 and 16 bits, half, float and double; grey, colour or any number of plain channels; both kinds of alpha.

The first directory is parsed here; the samples are decoded by OpenImageIO, apart from what it was found to get wrong:
16-bit grey whose zero is white is turned here, and tiled doubles, which come back as unset memory, are refused. Four
samples in a colour picture that does not say what the fourth is are colour and straight alpha, as the writers that
leave the tag out mean it. More than one grey channel without alpha is plain data.

Files are written uncompressed in one strip, each picture of an image with several as a page. Integers are
display-referred and floats linear unless a profile says otherwise; where the image disagrees, a profile naming its
space is written.

Source: TIFF 6.0 (Adobe, 1992), and technical note 3 for floats.
"""

from __future__ import annotations

import io

import numpy as np

from lichen.errors import UnreadableImage, UnsupportedFormat
from lichen.files import icc, ifd, memory_file
from lichen.files.format import Format, Header
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array

_WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC, _SAMPLES = 256, 257, 258, 259, 262, 277
_TILE_WIDTH, _EXTRA, _KIND, _PROFILE = 322, 338, 339, 34675
_WANTED = frozenset(
    [
        _WIDTH,
        _HEIGHT,
        _BITS,
        _COMPRESSION,
        _PHOTOMETRIC,
        _SAMPLES,
        _TILE_WIDTH,
        _EXTRA,
        _KIND,
        _PROFILE,
        ifd.ORIENTATION,
    ]
)
_STORAGES = {
    (8, 1): Storage.UINT8,
    (1, 1): Storage.UINT8,
    (16, 1): Storage.UINT16,
    (16, 3): Storage.FLOAT16,
    (32, 3): Storage.FLOAT32,
    (64, 3): Storage.FLOAT64,
}
_READ_AS = {Storage.FLOAT16: "half", Storage.FLOAT32: "float", Storage.FLOAT64: "double"}
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _PALETTE, _YCBCR = 0, 1, 2, 3, 6
_COVERAGE = {1: Alpha.ASSOCIATED, 2: Alpha.STRAIGHT}
_UNCOMPRESSED, _JPEG = 1, 7


def read_header(data: memoryview) -> Header:
    directory = ifd.read(data, _WANTED, {_PROFILE: icc.LARGEST})
    width, height = directory.number(_WIDTH, 0), directory.number(_HEIGHT, 0)
    if width < 1 or height < 1:
        raise UnreadableImage(f"The TIFF directory claims {width}x{height} pixels.")
    storage = _storage(directory)
    photometric = directory.number(_PHOTOMETRIC, _BLACK_IS_ZERO)
    stored = directory.number(_SAMPLES, 1)
    base = 3 if photometric in (_RGB, _YCBCR) else 1
    _check_kind(directory, photometric, stored - base, storage)
    extra = directory.numbers(_EXTRA)
    if not extra and base == 3 and stored == 4:
        extra = (2,)
    position, alpha = next(((base + i, _COVERAGE[x]) for i, x in enumerate(extra) if x in _COVERAGE), (-1, Alpha.NONE))
    if position >= stored:
        raise UnreadableImage("The TIFF directory names more extra samples than there are.")
    colours = 3 if photometric == _PALETTE else stored - (alpha is not Alpha.NONE)
    profile = directory.values.get(_PROFILE)
    natural = natural_space(storage)
    if base == 1 and photometric != _PALETTE and colours > 1:
        natural, profile = Space.DATA, None
    packed = (
        bytes(profile)
        if isinstance(profile, tuple) and all(type(x) is int and 0 <= x < 256 for x in profile)
        else profile
    )
    space, metadata = icc.read(packed if isinstance(packed, bytes) else None, 3 if base == 3 else colours, natural)
    orientation = directory.number(ifd.ORIENTATION, 1)
    orientation = orientation if 1 <= orientation <= 8 else 1
    if directory.number(_COMPRESSION, 1) == _UNCOMPRESSED:
        bits = width * height * stored * directory.number(_BITS, 1)
        if bits // 8 > len(data):
            raise UnreadableImage(f"{len(data)} bytes of uncompressed TIFF cannot hold {width}x{height} pixels.")
    order = None if position in (-1, stored - 1) else [*(i for i in range(stored) if i != position), position]
    turn = photometric == _WHITE_IS_ZERO and storage is Storage.UINT16
    if orientation >= 5:
        width, height = height, width
    return Header(
        "tiff",
        width,
        height,
        colours + (alpha is not Alpha.NONE),
        storage,
        space,
        alpha,
        directory.pages,
        orientation,
        metadata,
        details=(order, turn),
    )


def _storage(directory: ifd.Directory) -> Storage:
    bits, kinds = set(directory.numbers(_BITS)) or {1}, set(directory.numbers(_KIND)) or {1}
    storage = _STORAGES.get((min(bits), min(kinds))) if len(bits) == len(kinds) == 1 else None
    if storage is None:
        raise UnsupportedFormat(
            f"TIFF samples of {sorted(bits)} bits and format {sorted(kinds)} are not supported; "
            "unsigned 1, 8 and 16 bits and floats of 16, 32 and 64 bits are."
        )
    if storage is Storage.FLOAT64 and _TILE_WIDTH in directory.values:
        raise UnsupportedFormat("TIFF doubles in tiles are not supported; doubles in strips are.")
    return storage


def _check_kind(directory: ifd.Directory, photometric: int, extra: int, storage: Storage) -> None:
    if extra < 0:
        raise UnreadableImage("The TIFF directory claims fewer samples than its colours take.")
    compressed = directory.number(_COMPRESSION, 1)
    known = {
        _WHITE_IS_ZERO: storage.integer and extra == 0,
        _BLACK_IS_ZERO: True,
        _RGB: True,
        _PALETTE: storage is Storage.UINT8 and extra == 0,
        _YCBCR: storage is Storage.UINT8 and extra == 0 and compressed == _JPEG,
    }
    if not known.get(photometric, False):
        raise UnsupportedFormat(
            f"TIFF of photometric interpretation {photometric} is not supported like this; "
            "grey, RGB, 8-bit palettes and JPEG-compressed YCbCr are."
        )


def read_samples(data: memoryview, header: Header) -> Array:
    order, turn = header.details
    samples, _ = memory_file.read("tiff", [data], _READ_AS.get(header.storage, header.storage.value))
    if order and samples.shape[2] == len(order):
        samples = samples[:, :, order]
    return np.iinfo(samples.dtype).max - samples if turn else samples


def natural_space(storage: Storage) -> Space:
    return Space.SRGB if storage.integer else Space.LINEAR


def write(samples: Array, image: Image, quality: int | None) -> bytes:
    import tifffile  # heavy, and only this function needs it

    picture = image.space is not Space.DATA and image.colours >= 3
    extra = ["unspecified"] * (image.colours - (3 if picture else 1))
    if image.alpha is not Alpha.NONE:
        extra.append("assocalpha" if image.alpha is Alpha.ASSOCIATED else "unassalpha")
    target = io.BytesIO()
    shown = samples if samples.shape[2] > 1 else samples[:, :, 0]
    tifffile.imwrite(
        target,
        shown if image.pages == 1 else shown.reshape(image.pages, -1, *shown.shape[1:]),
        photometric="rgb" if picture else "minisblack",
        planarconfig="contig" if samples.shape[2] > 1 else None,
        extrasamples=extra or None,
        iccprofile=icc.to_write(image, natural_space(Storage(samples.dtype.name)), 3 if picture else image.colours),
        software=False,
        metadata=None,
    )
    return target.getvalue()


tiff = Format(
    name="tiff",
    media_types=("image/tiff",),
    extensions=(".tif", ".tiff"),
    storages=(Storage.UINT8, Storage.UINT16, Storage.FLOAT16, Storage.FLOAT32, Storage.FLOAT64),
    largest_side=(1 << 31) - 1,
    lossy=False,
    recognises=lambda head: head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
    natural_space=natural_space,
    unfit=lambda image: None,
    association=None,
    read_header=read_header,
    read_samples=read_samples,
    write=write,
    paged=True,
)
