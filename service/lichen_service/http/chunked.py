"""The chunked transfer coding, read strictly.

    chunk   = size-in-hex [ ; extension ] CR LF  data CR LF
    body    = *chunk  0 [ ; extension ] CR LF  *trailer-line  CR LF

h11 also decodes it, but drops the framing bytes unseen: bare line feeds between trailers, white space after a size,
bare carriage returns in extensions. Each is a known smuggling vector, so the framing is read here, where every byte
of it can be refused. No I/O: bytes in, consumed count out, the same result for every way of cutting the input.

Source: RFC 9112 section 7.1.
"""

from __future__ import annotations

import re
from enum import Enum, auto

from lichen_service.http.policy import Refusal, check_trailer

MOST_CHUNKS = 65_536
LONGEST_CHUNK_LINE = 1024
"""bytes of a size line or a trailer line, line end included"""
LARGEST_TRAILERS = 8192

_SIZE_LINE = re.compile(rb"([0-9A-Fa-f]{1,16})(?:;[\t\x20-\x7e]*)?\r\n")


class _Part(Enum):
    SIZE = auto()
    DATA = auto()
    DATA_END = auto()
    TRAILER = auto()
    DONE = auto()


class ChunkedBody:
    """Collects one chunked body of at most `largest` bytes into `body`."""

    def __init__(self, largest: int) -> None:
        self.body = bytearray()
        self._largest = largest
        self._part = _Part.SIZE
        self._line = bytearray()
        self._remaining = 0
        self._chunks = 0
        self._trailer_bytes = 0

    @property
    def done(self) -> bool:
        return self._part is _Part.DONE

    def feed(self, data: bytes | bytearray | memoryview) -> int | Refusal:
        """Take what belongs to the body; returns how many bytes that was, all of them until `done`."""
        view = memoryview(data)
        raw = data if isinstance(data, bytes | bytearray) else bytes(data)
        at = 0
        while at < len(raw) and self._part is not _Part.DONE:
            if self._part is _Part.DATA:
                taken = min(self._remaining, len(raw) - at)
                self.body += view[at : at + taken]
                at += taken
                self._remaining -= taken
                if not self._remaining:
                    self._part = _Part.DATA_END
                continue
            end = raw.find(b"\n", at)
            stop = len(raw) if end < 0 else end + 1
            self._line += view[at:stop]
            at = stop
            if len(self._line) > LONGEST_CHUNK_LINE:
                return _malformed(f"a line of the chunked coding is longer than {LONGEST_CHUNK_LINE} bytes")
            if end < 0:
                break
            line = bytes(self._line)
            self._line.clear()
            if refusal := self._take_line(line):
                return refusal
        return at

    def _take_line(self, line: bytes) -> Refusal | None:
        if self._part is _Part.SIZE:
            return self._take_size(line)
        if self._part is _Part.DATA_END:
            self._part = _Part.SIZE
            return None if line == b"\r\n" else _malformed("a chunk is longer than its size says")
        if line == b"\r\n":
            self._part = _Part.DONE
            return None
        self._trailer_bytes += len(line)
        if self._trailer_bytes > LARGEST_TRAILERS:
            return _malformed("the trailers are too large")
        return check_trailer(line)

    def _take_size(self, line: bytes) -> Refusal | None:
        match = _SIZE_LINE.fullmatch(line)
        if match is None:
            return _malformed("a chunk does not begin with its size in hexadecimal digits")
        self._remaining = int(match[1], 16)
        if not self._remaining:
            self._part = _Part.TRAILER
            return None
        self._part = _Part.DATA
        self._chunks += 1
        if self._chunks > MOST_CHUNKS:
            return Refusal(413, "too-many-chunks", f"the body comes in more than {MOST_CHUNKS} chunks", MOST_CHUNKS)
        if len(self.body) + self._remaining > self._largest:
            return Refusal(413, "too-large", f"the body is larger than {self._largest} bytes", self._largest)
        return None


def _malformed(detail: str) -> Refusal:
    return Refusal(400, "malformed-request", detail)
