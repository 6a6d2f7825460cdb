"""Image file directories: the tags of TIFF and BigTIFF, and of the EXIF block other formats carry.

A directory is a count, that many entries (tag, type, count, value or offset) and the offset of the next one. Offsets
come from outside, so each is checked. A chain that meets itself is refused, and so is a directory without entries,
which TIFF does not allow: a few bytes could hold thousands of either. Of a long chain no more is read than the limit
on pictures needs.
Sources: TIFF 6.0, section 2; BigTIFF (libtiff); EXIF 2.32, section 4.6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lichen.errors import UnreadableImage
from lichen.files.format import MOST_PAGES, take, unpack

ORIENTATION = 274
_LAYOUTS = {1: "B", 2: "s", 3: "H", 4: "I", 5: "II", 6: "b", 7: "s", 8: "h", 9: "i", 11: "f", 12: "d", 16: "Q"}
_ENTRIES = 1000
_LONGEST = 1024
"""Items that are read of a value."""


@dataclass(frozen=True)
class Directory:
    """The values of one directory by tag; unused types are left out, and long values are cut."""

    values: Mapping[int, Any]
    pages: int

    def number(self, tag: int, default: int) -> int:
        value = self.values.get(tag, (default,))
        return int(value[0]) if isinstance(value, tuple) and value else default

    def numbers(self, tag: int) -> tuple[int, ...]:
        value = self.values.get(tag, ())
        return tuple(int(item) for item in value) if isinstance(value, tuple) else ()


def read(
    data: memoryview, wanted: frozenset[int], longest: Mapping[int, int] | None = None, *, alone: bool = False
) -> Directory:
    """The first directory, and how many there are (counted to `MOST_PAGES`; the others are not looked for where it is
    wanted `alone`). `longest`: of which tags more items than usual are read, and how many. Raises `UnreadableImage`."""
    order = {b"II": "<", b"MM": ">"}.get(bytes(data[:2]))
    version = unpack(f"{order}H", data, 2, "TIFF header")[0] if order else 0
    if version == 42:
        big, start = False, unpack(f"{order}I", data, 4, "TIFF header")[0]
    elif version == 43:
        big = True
        size, zero, start = unpack(f"{order}HHQ", data, 4, "BigTIFF header")
        if (size, zero) != (8, 0):
            raise UnreadableImage("The BigTIFF header does not use offsets of eight bytes.")
    else:
        raise UnreadableImage("The bytes do not begin with a TIFF header.")
    first: Mapping[int, Any] | None = None
    seen: set[int] = set()
    while start and len(seen) < (1 if alone else MOST_PAGES):
        if start in seen:
            raise UnreadableImage("The TIFF directories lead back to one that came before.")
        if first is not None and start + 8 > len(data):
            break
        seen.add(start)
        count = unpack(f"{order}{'Q' if big else 'H'}", data, start, "directory")[0]
        body, width = start + (8 if big else 2), 20 if big else 12
        if not count:
            raise UnreadableImage("A TIFF directory has no entries.")
        if first is None:
            if count > _ENTRIES:
                raise UnreadableImage(f"The first directory claims {count} entries.")
            entries = take(data, body, count * width, "directory")
            first = _values(data, entries, f"{order}", big, wanted, longest or {})
        end = body + count * width
        if end + (8 if big else 4) > len(data):
            break
        start = unpack(f"{order}{'Q' if big else 'I'}", data, end, "directory")[0]
    if first is None:
        raise UnreadableImage("The file holds no directory.")
    return Directory(first, len(seen))


def _values(
    data: memoryview, entries: memoryview, order: str, big: bool, wanted: frozenset[int], longest: Mapping[int, int]
) -> dict[int, Any]:
    values: dict[int, Any] = {}
    width, inline = (20, 8) if big else (12, 4)
    for i in range(0, len(entries), width):
        tag, kind, count = unpack(f"{order}HH{'Q' if big else 'I'}", entries, i, "directory")
        layout = _LAYOUTS.get(kind)
        if layout is None or tag not in wanted or tag in values:
            continue
        item = len(layout) * {"B": 1, "s": 1, "b": 1, "H": 2, "h": 2, "d": 8, "Q": 8}.get(layout[0], 4)
        at = i + (12 if big else 8)
        source, start = entries, at
        if count * item > inline:
            source, start = data, unpack(f"{order}{'Q' if big else 'I'}", entries, at, "directory")[0]
        if layout == "s":
            values[tag] = bytes(take(source, start, count, f"tag {tag}"))
        else:
            layout = f"{order}{layout * min(count, longest.get(tag, _LONGEST))}"
            values[tag] = unpack(layout, source, start, f"tag {tag}")
    return values


def orientation(exif: bytes | memoryview) -> int:
    """The orientation an EXIF block states; 1 where it states none, or is damaged (it is not worth a refusal)."""
    block = memoryview(exif)
    if bytes(block[:6]) == b"Exif\0\0":
        block = block[6:]
    try:
        value = read(block, frozenset([ORIENTATION]), alone=True).number(ORIENTATION, 1)
    except UnreadableImage:
        return 1
    return value if 1 <= value <= 8 else 1
