"""OpenEXR: half or float, any number of named channels, associated alpha, scene-linear.

Channels come in this order: R, G, B (or Y alone), then all others by layer and name, then A. So an image's last channel
is its coverage, as everywhere, and a file of other names is plain data in order of name. The data window is the image;
its place in the display window is dropped. Of several parts the first is read; deep and subsampled files and
integer channels are refused.

Attributes are carried byte for byte from file to file. `colorInteropID` says what the numbers are when the
natural reading (linear light, primaries of BT.709) does not hold.

Files are written as zipped scanlines by this module: the library takes several times as long, stamps the time of
day into the header and renames attributes. Source: "OpenEXR File Layout" (openexr.com), and its ZIP compression:
bytes split into even and odd, each less its predecessor plus 128, deflated.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from lichen.errors import UnreadableImage, UnsupportedFormat
from lichen.files import deflate, memory_file
from lichen.files.format import MOST_PAGES, MOST_PARTS, Data, Format, Header, few, take, unpack
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, joined
from lichen.processors import each

SIGNATURE = b"\x76\x2f\x31\x01"
_LONG_NAMES, _DEEP, _MULTIPART = 0x400, 0x800, 0x1000
_HALF, _FLOAT = 1, 2
_ZIP, _LINES = 3, 16
_STRUCTURAL = frozenset(
    [
        "channels",
        "compression",
        "dataWindow",
        "displayWindow",
        "lineOrder",
        "tiles",
        "type",
        "name",
        "version",
        "chunkCount",
        "view",
        "multiView",
        "preview",
        "envmap",
        "maxSamplesPerPixel",
        "colorInteropID",
    ]
)
_MEANINGS = {
    "lin_rec709_scene": Space.LINEAR,
    "srgb_rec709_scene": Space.SRGB,
    "srgb_rec709_display": Space.SRGB,
    "data": Space.DATA,
}
_NAMED = {Space.LINEAR: "lin_rec709_scene", Space.SRGB: "srgb_rec709_scene", Space.DATA: "data"}
_BT709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
_CARRIED = 1 << 20
"""Bytes; longer attributes are left behind."""

Attributes = dict[str, tuple[str, memoryview]]


@dataclass(frozen=True, slots=True)
class _Arrangement:
    order: tuple[str, ...]
    picture: bool
    coverage: bool


def _text(data: memoryview, start: int) -> tuple[str, int]:
    """The zero-terminated name at `start`, at most 255 bytes, and where it ends."""
    raw, zero, _ = bytes(data[start : start + 256]).partition(b"\0")
    if not zero:
        raise UnreadableImage("The EXR header holds a name without an end.")
    try:
        return raw.decode(), start + len(raw) + 1
    except UnicodeDecodeError:
        raise UnreadableImage("The EXR header holds a name that is not UTF-8.") from None


def _attributes(data: memoryview, start: int) -> tuple[Attributes, int]:
    found: Attributes = {}
    for _ in few(count(), "attributes"):
        name, start = _text(data, start)
        if not name:
            break
        kind, start = _text(data, start)
        size = unpack("<i", data, start, "EXR header")[0]
        found[name] = (kind, take(data, start + 4, size, f"EXR attribute {name!r}"))
        start += 4 + size
    return found, start


def read_header(data: memoryview) -> Header:
    version = unpack("<I", data, 4, "EXR header")[0]
    if version & 0xFF != 2:
        raise UnreadableImage(f"EXR version {version & 0xFF} is not known.")
    found, end = _attributes(data, 8)
    parts, held = 1, len(found)
    while version & _MULTIPART and parts < MOST_PAGES and held < MOST_PARTS:
        following, end = _attributes(data, end)
        held += len(following)
        if not following:
            break
        parts += 1
    if version & _DEEP or bytes(found.get("type", ("", memoryview(b"")))[1])[:4] == b"deep":
        raise UnsupportedFormat("Deep EXR is not supported; flat scanlines and tiles are.")
    if "channels" not in found or "dataWindow" not in found:
        raise UnreadableImage("The EXR header lacks its channels or its data window.")
    kinds = _channels(found["channels"][1])
    left, top, right, bottom = unpack("<4i", found["dataWindow"][1], 0, "EXR data window")
    if right < left or bottom < top:
        raise UnreadableImage("The EXR data window is empty.")
    meaning = bytes(found["colorInteropID"][1]).decode("latin-1") if "colorInteropID" in found else ""
    plan = _arrange(list(kinds), _MEANINGS.get(meaning) is not Space.DATA)
    space = _MEANINGS.get(meaning, Space.LINEAR) if plan.picture else Space.DATA
    metadata: dict[str, Any] = {"channel_names": plan.order}
    carried = {
        name: (kind, bytes(value))
        for name, (kind, value) in found.items()
        if name not in _STRUCTURAL and len(value) <= _CARRIED
    }
    if carried:
        metadata["exr_attributes"] = carried
    if note := _note(carried, meaning):
        metadata["colour_note"] = note
    return Header(
        "exr",
        right - left + 1,
        bottom - top + 1,
        len(kinds),
        Storage.FLOAT32 if _FLOAT in kinds.values() else Storage.FLOAT16,
        space,
        Alpha.ASSOCIATED if plan.coverage else Alpha.NONE,
        parts,
        metadata=metadata,
        details=plan.order,
    )


def _channels(block: memoryview) -> dict[str, int]:
    """Sample type of each channel by name."""
    kinds: dict[str, int] = {}
    start = 0
    while True:
        name, start = _text(block, start)
        if not name:
            break
        kind, _, across, down = unpack("<iIii", block, start, "EXR channels")
        start += 16
        if kind not in (_HALF, _FLOAT) or (across, down) != (1, 1) or name in kinds:
            raise UnsupportedFormat(f"The EXR channel {name!r} is neither half nor float at full resolution.")
        kinds[name] = kind
    if not kinds:
        raise UnreadableImage("The EXR file has no channels.")
    return kinds


def _arrange(names: Sequence[str], light: bool) -> _Arrangement:
    """Colour first, coverage last, everything else by layer and name between them."""
    present = set(names)
    layers = [name[:-1] for name in names if name == "R" or name.endswith(".R")]
    whole = [layer for layer in layers if {layer + "R", layer + "G", layer + "B"} <= present]
    colour: list[str] = []
    layer = ""
    if "" in whole or len(whole) == 1:
        layer = "" if "" in whole else whole[0]
        colour = [layer + letter for letter in "RGB"]
    elif "Y" in present and present <= {"Y", "A"}:
        colour = ["Y"]
    coverage = [layer + "A"] if light and colour and layer + "A" in present else []
    rest = sorted(present - set(colour) - set(coverage), key=_place)
    return _Arrangement((*colour, *rest, *coverage), light and bool(colour), bool(coverage))


def _place(name: str) -> tuple[str, int, str]:
    layer, _, own = name.rpartition(".")
    return layer, {"R": 0, "G": 1, "B": 2, "A": 4}.get(own, 3), own


def _note(carried: Mapping[str, tuple[str, bytes]], meaning: str) -> str | None:
    if meaning and meaning not in _MEANINGS:
        return f"The colour space {meaning[:60]!r} is not converted; the numbers are taken as linear BT.709."
    kind, value = carried.get("chromaticities", ("", b""))
    if kind == "chromaticities" and len(value) == 32:
        distance = max(abs(a - b) for a, b in zip(struct.unpack("<8f", value), _BT709, strict=True))
        if not distance < 0.002:
            return "The chromaticities are carried along; the pixels are not converted from them to BT.709."
    return None


def read_samples(data: memoryview, header: Header) -> Array:
    samples, names = memory_file.read("openexr", [data], "half" if header.storage is Storage.FLOAT16 else "float")
    positions = {name: i for i, name in enumerate(names)}
    if positions.keys() != set(header.details):
        raise UnreadableImage("The EXR channels are not those of its header.")
    order = [positions[name] for name in header.details]
    return samples if order == list(range(len(order))) else samples[:, :, order]


# ------------------------------------------------------------------------------------------------------- writing


def write(samples: Array, image: Image, quality: int | None) -> Data:
    rows, columns, channels = samples.shape
    names = _names(image)
    order = sorted(range(channels), key=lambda i: names[i].encode())
    header = _header_bytes(image, [names[i] for i in order], columns, rows, samples.dtype.itemsize == 2)
    stored = samples.dtype.newbyteorder("<")
    starts = range(0, rows, _LINES)

    def pack(start: int) -> bytes:
        lines = samples[start : start + _LINES].transpose(0, 2, 1)[:, order, :]
        plain = np.ascontiguousarray(lines, stored).view(np.uint8).reshape(-1)
        packed = deflate.compress(_differences(plain).data)
        body = packed if len(packed) < plain.size else plain.tobytes()
        return struct.pack("<ii", start, len(body)) + body

    blocks = each(pack, starts)
    lengths = np.array([len(block) for block in blocks], np.uint64)
    first = len(header) + 8 * len(blocks)
    offsets = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype("<u8") + np.uint64(first)
    return joined([header, offsets.astype("<u8").tobytes(), *blocks])


def _differences(plain: Array) -> Array:
    """Even bytes then odd bytes, each less the one before it plus 128."""
    half = (plain.size + 1) // 2
    split = np.empty_like(plain)
    split[:half], split[half:] = plain[0::2], plain[1::2]
    result = np.empty_like(plain)
    result[0] = split[0]
    np.subtract(split[1:], split[:-1], out=result[1:])
    result[1:] += np.uint8(128)
    return result


def _names(image: Image) -> list[str]:
    """The names the channels came with, where they still fit, or usual ones."""
    carried = image.metadata.get("channel_names", ())
    covered = image.alpha is not Alpha.NONE
    if len(carried) == len(set(carried)) == image.channels and all(_good(name) for name in carried):
        plan = _arrange(carried, True)
        if image.space is Space.DATA or (plan.order == tuple(carried) and plan.picture and plan.coverage == covered):
            return [str(name) for name in carried]
    count = image.colours
    if image.space is Space.DATA and image.channels == 4:
        return ["R", "G", "B", "A"]
    colours = {1: ["Y"], 2: ["X", "Y"], 3: ["R", "G", "B"]}.get(count)
    if colours is None:
        first = [] if image.space is Space.DATA else ["R", "G", "B"]
        colours = [*first, *(f"channel{i:03}" for i in range(len(first), count))]
    return [*colours, "A"] if covered else colours


def _good(name: Any) -> bool:
    return isinstance(name, str) and 0 < len(name.encode()) < 256 and "\0" not in name


def _header_bytes(image: Image, names: Sequence[str], columns: int, rows: int, half: bool) -> bytes:
    kind = struct.pack("<iIii", _HALF if half else _FLOAT, 0, 1, 1)
    window = struct.pack("<4i", 0, 0, columns - 1, rows - 1)
    attributes: dict[str, tuple[str, bytes]] = {
        "channels": ("chlist", b"".join(name.encode() + b"\0" + kind for name in names) + b"\0"),
        "compression": ("compression", bytes([_ZIP])),
        "dataWindow": ("box2i", window),
        "displayWindow": ("box2i", window),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1)),
        "screenWindowCenter": ("v2f", bytes(8)),
        "screenWindowWidth": ("float", struct.pack("<f", 1)),
    }
    carried: Mapping[str, tuple[str, bytes]] = image.metadata.get("exr_attributes", {})
    for name, (kind_name, value) in carried.items():
        if name == "chromaticities" and image.space is not Space.LINEAR:
            continue
        attributes[name] = (kind_name, value)
    if not (image.space is Space.LINEAR and _note(attributes, "")):
        attributes["colorInteropID"] = ("string", _NAMED[image.space].encode())
    long_names = max(len(name.encode()) for name in [*names, *attributes]) > 31
    parts = [SIGNATURE, struct.pack("<I", 2 | (_LONG_NAMES if long_names else 0))]
    for name, (kind_name, value) in attributes.items():
        parts += [name.encode(), b"\0", kind_name.encode(), b"\0", struct.pack("<i", len(value)), value]
    return b"".join([*parts, b"\0"])


exr = Format(
    name="exr",
    media_types=("image/x-exr", "image/exr", "image/aces"),
    extensions=(".exr",),
    storages=(Storage.FLOAT16, Storage.FLOAT32),
    largest_side=(1 << 31) - 1,
    lossy=False,
    recognises=lambda head: head.startswith(SIGNATURE),
    natural_space=lambda storage: Space.LINEAR,
    unfit=lambda image: None,
    association=Alpha.ASSOCIATED,
    read_header=read_header,
    read_samples=read_samples,
    write=write,
)
