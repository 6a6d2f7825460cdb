"""WebP: 8 bits, three colours, straight alpha; lossless unless a quality is asked for.

Reading parses the RIFF chunks for size, alpha, profile, orientation and frames; of an animation the first frame is
decoded. Writing without a quality is exact, the colour of transparent pixels included. Grey is written as three equal
colours, since the format knows no other. Several pictures become an animation that repeats for ever.

Sources: RFC 9649 (container and lossless bitstream), RFC 6386 section 9.1 (lossy frame header).
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from lichen.errors import UnreadableImage
from lichen.files import icc, ifd
from lichen.files.format import MOST_PAGES, Format, Header, few, picture_channels, take, unpack
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array

_ALPHA = 0x10
FRAME_MS = 42
"""How long each picture of an animation is shown: 24 a second."""


def _chunks(data: memoryview) -> Iterator[tuple[bytes, memoryview]]:
    size = unpack("<I", data, 4, "RIFF header")[0]
    body = take(data, 8, size, "RIFF chunks")
    start = 4
    while start + 8 <= len(body):
        name, size = unpack("<4sI", body, start, "RIFF chunks")
        yield name, take(body, start + 8, size, "RIFF chunks")
        start += 8 + size + size % 2


def read_header(data: memoryview) -> Header:
    width = height = frames = 0
    alpha, orientation, profile = False, 1, None
    for name, body in few(_chunks(data), "chunks"):
        if not width and name == b"VP8X":
            flags, right, bottom = unpack("<I3s3s", body, 0, "VP8X chunk")
            alpha = bool(flags & _ALPHA)
            width, height = 1 + int.from_bytes(right, "little"), 1 + int.from_bytes(bottom, "little")
        elif not width and name == b"VP8L":
            mark, packed = unpack("<BI", body, 0, "VP8L chunk")
            if mark != 0x2F or packed >> 29:
                raise UnreadableImage("The lossless WebP header is not valid.")
            width, height = 1 + (packed & 0x3FFF), 1 + (packed >> 14 & 0x3FFF)
            alpha = bool(packed >> 28 & 1)
        elif not width and name == b"VP8 ":
            tag, start, across, down = unpack("<3s3sHH", body, 0, "VP8 chunk")
            if start != b"\x9d\x01\x2a" or tag[0] & 1:
                raise UnreadableImage("The lossy WebP header is not valid.")
            width, height = across & 0x3FFF, down & 0x3FFF
        elif not width:
            raise UnreadableImage(f"The WebP file begins with {name!r}, not with an image.")
        elif name == b"ICCP":
            profile = bytes(body)
        elif name == b"EXIF":
            orientation = ifd.orientation(body)
        elif name == b"ANMF":
            frames += 1
            if frames == MOST_PAGES:
                break
    if 0 in (width, height):
        raise UnreadableImage("The WebP file holds no image.")
    space, metadata = icc.read(profile, 3, Space.SRGB)
    if orientation >= 5:
        width, height = height, width
    return Header(
        "webp",
        width,
        height,
        3 + alpha,
        Storage.UINT8,
        space,
        Alpha.STRAIGHT if alpha else Alpha.NONE,
        max(frames, 1),
        orientation,
        metadata,
    )


@cache
def _library() -> Any:
    import cv2  # heavy, and only this format needs it

    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # damage is reported, not printed
    return cv2


def read_samples(data: memoryview, header: Header) -> Array:
    cv2 = _library()
    try:
        samples: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as failure:
        raise UnreadableImage(f"The WebP file is damaged: {failure.err}.") from None
    if samples is None or samples.ndim != 3:
        raise UnreadableImage("The WebP file is damaged or incomplete.")
    if samples.shape[2] == 3:
        cv2.cvtColor(samples, cv2.COLOR_BGR2RGB, dst=samples)
        if header.channels == 4:  # the container announces alpha, the image has none: it is opaque
            samples = np.dstack([samples, np.full(samples.shape[:2], 255, np.uint8)])
    else:
        cv2.cvtColor(samples, cv2.COLOR_BGRA2RGBA, dst=samples)
    return np.asarray(samples)[:, :, : header.channels]


def write(samples: Array, image: Image, quality: int | None) -> bytes:
    from PIL import Image as Pictures  # alone in keeping the colour of transparent pixels

    if samples.shape[2] == 1:
        samples = np.repeat(samples, 3, axis=2)
    options: dict[str, Any] = {"lossless": True, "exact": True, "method": 0, "quality": 0}
    if quality is not None:
        options = {"quality": quality, "method": 2, "exact": True}
    if profile := icc.to_write(image, Space.SRGB, 3):
        options["icc_profile"] = profile
    target = io.BytesIO()
    first, *others = (Pictures.fromarray(each) for each in np.split(samples, image.pages))
    if others:
        options |= {"save_all": True, "append_images": others, "duration": FRAME_MS, "loop": 0}
    first.save(target, "webp", **options)
    return target.getvalue()


webp = Format(
    name="webp",
    media_types=("image/webp",),
    extensions=(".webp",),
    storages=(Storage.UINT8,),
    largest_side=16_383,
    lossy=True,
    recognises=lambda head: head[:4] == b"RIFF" and head[8:12] == b"WEBP",
    natural_space=lambda storage: Space.SRGB,
    unfit=picture_channels("webp", grey_alpha=False),
    association=Alpha.STRAIGHT,
    read_header=read_header,
    read_samples=read_samples,
    write=write,
    paged=True,
)
