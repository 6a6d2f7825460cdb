"""Answers of several parts: a result, what the operation found, and the map of the error (RFC 2046, multipart/mixed).

A caller who names `multipart/mixed` in `Accept`, liked no less than any image type there, gets beside the result the
findings of an operation that reports some, as JSON, and the map where verification was asked for; wildcards do not
count, since who sends `*/*` expects a picture. The other media types decide the format of the result.

The map shows the largest difference over the channels of each pixel: as PNG in false colour, logarithmic over four
decades below the largest, transparent where truth was not evaluated; beside an NPY result as NPY, with NaN there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np

from lichen.files import Encoded, encode
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, aligned
from lichen_service.http.message import Body

MIXED = "multipart/mixed"
DECADES = 4
RAMP = np.array(
    [(0.05, 0.04, 0.16), (0.31, 0.10, 0.46), (0.73, 0.22, 0.38), (0.95, 0.56, 0.24), (0.99, 0.95, 0.72)], np.float64
)
"""sRGB, ever lighter: small errors are dark."""

Part = tuple[Mapping[str, str], Body]


def of_the_result(accept: str | None) -> str | None:
    """What an `Accept` value says of the parts: the elements that are no multipart types; None where none is left."""
    elements = [each.strip() for each in (accept or "").split(",")]
    return ", ".join(each for each in elements if each and not each.lower().startswith("multipart/")) or None


def join(parts: Sequence[Part]) -> tuple[str, bytes]:
    """The content type and the body. The same parts give the same bytes: the boundary is their digest."""
    digest = hashlib.sha256()
    for _, body in parts:
        digest.update(body)
    boundary = digest.hexdigest()[:40]
    pieces: list[Body] = []
    for headers, body in parts:
        head = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        pieces += [f"--{boundary}\r\n{head}\r\n".encode(), body, b"\r\n"]
    return f'{MIXED}; boundary="{boundary}"', b"".join([*pieces, f"--{boundary}--\r\n".encode()])


def error_map(errors: Array, format: str) -> tuple[Encoded, str]:
    """The map to go with a result of this format, and its scale as the value of `Lichen-Map`."""
    if format == "npy":
        return encode(Image(aligned(errors[:, :, np.newaxis])), "npy"), "linear; untaken=nan"
    high = float(np.nanmax(errors, initial=0.0))
    low = high * 10.0**-DECADES
    taken = np.isfinite(errors)
    shown = np.zeros((*errors.shape, 4), np.float32)
    if high > 0:
        height = 1 + np.log10(np.clip(np.where(taken, errors, low), low, high) / high) / DECADES
    else:
        height = np.zeros(errors.shape)
    stops = np.linspace(0, 1, len(RAMP))
    for channel in range(3):
        shown[..., channel] = np.where(taken, np.interp(height, stops, RAMP[:, channel]), 0)
    shown[..., 3] = taken
    picture = Image(aligned(shown), Space.SRGB, Alpha.STRAIGHT, Storage.UINT8)
    return encode(picture, "png"), f"log10; low={low:.3g}; high={high:.3g}; untaken=transparent"
