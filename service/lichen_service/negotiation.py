"""Which format a result is sent in.

Rules (RFC 9110, section 12.5.1): a media range matches exactly, by type (`image/*`) or by `*/*`; the most specific
range that matches a format gives its quality; quality 0 excludes. Among formats of equal quality the order of
preference decides, which the caller gives. Elements that are no media range are ignored; an `Accept` without
a single good element counts as absent. No I/O and no knowledge of images: media types in, a choice out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

_TOKEN = r"[!#$%&'*+.^_`|~0-9A-Za-z-]+"
_RANGE = re.compile(rf"({_TOKEN})/({_TOKEN})")
_QUALITY = re.compile(r"(?:0(?:\.\d{0,3})?|1(?:\.0{0,3})?)")


@dataclass(frozen=True, slots=True)
class MediaRange:
    type: str
    subtype: str
    quality: float

    def specificity(self, media_type: str) -> int:
        """0 when it does not match, else more for a narrower range."""
        kind, _, sub = media_type.partition("/")
        if self.type == "*":
            return 1 if self.subtype == "*" else 0
        if self.type != kind:
            return 0
        if self.subtype == "*":
            return 2
        return 3 if self.subtype == sub else 0


def media_type_of(header: str) -> str:
    """The bare lower-case media type of a `Content-Type` value.

    >>> media_type_of('Image/PNG; q="a;b"')
    'image/png'
    """
    return header.partition(";")[0].strip().lower()


def parse_accept(header: str) -> tuple[MediaRange, ...]:
    """The media ranges of an `Accept` value in the order given; malformed elements are left out."""
    ranges = []
    for element in header.split(","):
        name, *parameters = (part.strip() for part in element.split(";"))
        match = _RANGE.fullmatch(name)
        if match is None:
            continue
        quality = 1.0
        for parameter in parameters:
            key, _, value = (part.strip() for part in parameter.partition("="))
            if key.lower() == "q":
                quality = float(value) if _QUALITY.fullmatch(value) else -1.0
                break
        if quality >= 0:
            ranges.append(MediaRange(match[1].lower(), match[2].lower(), quality))
    return tuple(ranges)


def prefers(accept: str | None, media_type: str) -> bool:
    """Whether an `Accept` value names a media type, wildcards not counted, and likes nothing better."""
    ranges = parse_accept(accept or "")
    quality = max((each.quality for each in ranges if f"{each.type}/{each.subtype}" == media_type), default=0.0)
    return quality > 0 and all(each.quality <= quality for each in ranges)


def quality_of(ranges: Sequence[MediaRange], media_types: Sequence[str]) -> float:
    """Quality of a format known by several media types: the best of them; 0 means not acceptable."""
    return max((_quality(ranges, media_type) for media_type in media_types), default=0.0)


def _quality(ranges: Sequence[MediaRange], media_type: str) -> float:
    matches = [(each.specificity(media_type), each.quality) for each in ranges]
    narrowest = max((specificity for specificity, _ in matches), default=0)
    if narrowest == 0:
        return 0.0
    return max(quality for specificity, quality in matches if specificity == narrowest)


def acceptable(accept: str | None, formats: Mapping[str, Sequence[str]], preference: Sequence[str]) -> tuple[str, ...]:
    """The names of the formats that may be sent, best first.

    `formats` maps a name to its media types, `preference` orders names that the client likes equally well (names it
    leaves out follow in the order of `formats`).
    """
    ordered = [*dict.fromkeys(name for name in preference if name in formats)]
    ordered += [name for name in formats if name not in ordered]
    ranges = parse_accept(accept or "")
    if not ranges:
        return tuple(ordered)
    qualities = {name: quality_of(ranges, formats[name]) for name in ordered}
    return tuple(sorted((name for name in ordered if qualities[name] > 0), key=lambda name: -qualities[name]))
