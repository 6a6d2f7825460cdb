"""ICC profiles: told apart, carried, and written where a file could not say otherwise what its numbers mean.

A profile made of three primaries and curves is compared with sRGB by its numbers, not its name: primaries adapted to
D50 (IEC 61966-2-1, as every sRGB profile holds them) and the curve sampled. Sources: ICC.1:2022, sections 7 to 10.
A profile that is neither sRGB nor linear with sRGB's primaries is carried with the image byte for byte and written
into outputs that can hold one; the pixels are not converted by it, and the image's metadata says so.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.image import Image, Space
from lichen.memory import Array

LARGEST = 4 << 20
"""Bytes; a larger profile is refused."""

_PRIMARIES = np.array([[0.43607, 0.22249, 0.01392], [0.38515, 0.71687, 0.09708], [0.14307, 0.06061, 0.71410]])
"""Rows: XYZ of the red, green and blue primary of BT.709 and sRGB, adapted from D65 to D50."""
_WHITE = (0.9642, 1.0, 0.8249)
_ADAPTATION = (1.04788, 0.02292, -0.05022, 0.02959, 0.99048, -0.01707, -0.00925, 0.01508, 0.75168)
"""Bradford, D65 to D50."""
_SRGB_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
"""g, a, b, c, d of the ICC parametric curve of type 3."""


def read(profile: bytes | None, colours: int, natural: Space) -> tuple[Space, dict[str, Any]]:
    """Space and metadata for a picture of `colours` channels that holds `profile`."""
    if profile is None:
        return natural, {}
    if not _fits(profile, colours):
        return natural, {"colour_note": "An ICC profile that does not describe these channels was dropped."}
    known = space(profile)
    if known is not None:
        return known, {"icc": profile}
    note = f"The ICC profile {description(profile)!r} is carried along; the pixels are not converted by it."
    return Space.SRGB, {"icc": profile, "colour_note": note}


def to_write(image: Image, natural: Space, colours: int) -> bytes | None:
    """The profile for a file of `colours` channels: the carried one while it holds, or one that names the space."""
    carried = image.metadata.get("icc")
    if isinstance(carried, bytes) and _fits(carried, colours) and (space(carried) or Space.SRGB) is image.space:
        return carried
    if image.space in (natural, Space.DATA) or colours not in (1, 3):
        return None
    return make(image.space, grey=colours == 1)


def _fits(profile: bytes, colours: int) -> bool:
    kind = {1: b"GRAY", 3: b"RGB "}.get(colours)
    return len(profile) >= 132 and profile[36:40] == b"acsp" and profile[16:20] == kind


def space(profile: bytes) -> Space | None:
    """SRGB or LINEAR where the profile says just that by its numbers; None where it says anything else."""
    tags = _tags(profile)
    grey = profile[16:20] == b"GRAY"
    if not grey:
        primaries = [_xyz(tags.get(name, b"")) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
        if b"A2B0" in tags or any(primary is None for primary in primaries):
            return None
        if np.abs(np.array(primaries) - _PRIMARIES).max() > 0.003:
            return None
    x = np.linspace(0.0, 1.0, 65)
    curves = [_curve(tags.get(name, b""), x) for name in ((b"kTRC",) if grey else (b"rTRC", b"gTRC", b"bTRC"))]
    for known, expected in ((Space.SRGB, _parametric(3, _SRGB_CURVE, x)), (Space.LINEAR, x)):
        if all(curve is not None and np.abs(curve - expected).max() < 0.002 for curve in curves):
            return known
    return None


def description(profile: bytes) -> str:
    """The profile's own name for itself."""
    tag = _tags(profile).get(b"desc", b"")
    if tag[:4] == b"mluc" and len(tag) >= 28:
        size, start = struct.unpack_from(">II", tag, 20)
        text = tag[start : start + size].decode("utf-16-be", "replace")
    else:
        text = tag[12:].split(b"\0")[0].decode("latin-1")
    return "".join(letter for letter in text if letter.isprintable())[:80] or "unnamed"


def _tags(profile: bytes) -> Mapping[bytes, bytes]:
    count = min(struct.unpack_from(">I", profile, 128)[0], 100)
    tags = {}
    for i in range(count):
        entry = profile[132 + 12 * i : 144 + 12 * i]
        if len(entry) == 12:
            name, start, size = struct.unpack(">4sII", entry)
            tags[name] = profile[start : start + size]
    return tags


def _xyz(tag: bytes) -> list[float] | None:
    if tag[:4] != b"XYZ " or len(tag) < 20:
        return None
    return [value / 65536 for value in struct.unpack_from(">3i", tag, 8)]


def _curve(tag: bytes, x: Array) -> Array | None:
    """The curve's values at `x`, or None where the tag is none."""
    if len(tag) < 12:
        return None
    if tag[:4] == b"para":
        kind = struct.unpack_from(">H", tag, 8)[0]
        count = {0: 1, 1: 3, 2: 4, 3: 5, 4: 7}.get(kind, 0)
        if not count or len(tag) < 12 + 4 * count:
            return None
        return _parametric(kind, [value / 65536 for value in struct.unpack_from(f">{count}i", tag, 12)], x)
    count = struct.unpack_from(">I", tag, 8)[0]
    if tag[:4] != b"curv" or len(tag) < 12 + 2 * count:
        return None
    if count == 0:
        return x
    table = np.frombuffer(tag, ">u2", count, 12).astype(float)
    if count == 1:
        return np.asarray(x ** (table[0] / 256))
    return np.asarray(np.interp(x, np.linspace(0.0, 1.0, count), table / 65535))


def _parametric(kind: int, values: Any, x: Array) -> Array | None:
    """The parametric curves 0 (a power) and 3 (a power with a linear foot), the two that describe known spaces."""
    if kind == 0:
        return np.asarray(x ** values[0])
    if kind != 3:
        return None
    g, a, b, c, d = values
    return np.asarray(np.where(x >= d, np.maximum(a * x + b, 0.0) ** g, c * x))


def make(meaning: Space, *, grey: bool) -> bytes:
    """A version 4 display profile of sRGB, or of linear light with its primaries; about 500 bytes, always the same."""
    name = "Lichen sRGB" if meaning is Space.SRGB else "Lichen linear BT.709"
    if meaning is Space.SRGB:
        curve = b"para" + struct.pack(">IHH5i", 0, 3, 0, *_fixed(_SRGB_CURVE))
    else:
        curve = b"curv" + struct.pack(">II", 0, 0)
    tags = {
        b"desc": _text(name),
        b"cprt": _text("No copyright, use freely"),
        b"wtpt": b"XYZ \0\0\0\0" + struct.pack(">3i", *_fixed(_WHITE)),
        b"chad": b"sf32\0\0\0\0" + struct.pack(">9i", *_fixed(_ADAPTATION)),
    }
    if grey:
        tags[b"kTRC"] = curve
    else:
        for letter, primary in zip((b"r", b"g", b"b"), _PRIMARIES, strict=True):
            tags[letter + b"XYZ"] = b"XYZ \0\0\0\0" + struct.pack(">3i", *_fixed(primary))
            tags[letter + b"TRC"] = curve
    table, body = struct.pack(">I", len(tags)), b""
    start = 132 + 12 * len(tags)
    for tag, value in tags.items():
        table += struct.pack(">4sII", tag, start + len(body), len(value))
        body += value + bytes(-len(value) % 4)
    head = struct.pack(
        ">I4sI4s4s4s", start + len(body), b"", 0x04300000, b"mntr", b"GRAY" if grey else b"RGB ", b"XYZ "
    )
    head += struct.pack(">6H4s", 2026, 1, 1, 0, 0, 0, b"acsp") + bytes(28) + struct.pack(">3i", *_fixed(_WHITE))
    return head + bytes(128 - len(head)) + table + body


def _fixed(values: Any) -> list[int]:
    return [round(float(value) * 65536) for value in values]


def _text(text: str) -> bytes:
    encoded = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">III2s2sII", 0, 1, 12, b"en", b"US", len(encoded), 28) + encoded
