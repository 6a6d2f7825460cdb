"""Deflate, as PNG and EXR use it: fast, in parallel, and never past a bound.

ISA-L's level 1 takes a fifth of the time of zlib's and makes files no larger on photographs. Bands have a size of
their own, whatever the number of threads, so the same image gives the same bytes on every machine.
"""

from __future__ import annotations

import zlib
from typing import cast

from isal import isal_zlib

from lichen.errors import TooLarge, UnreadableImage

LEVEL = 1
_Failure = cast(type[Exception], isal_zlib.error)  # the stub declares an instance

checksum = isal_zlib.crc32
adler = isal_zlib.adler32


def band(data: bytes | memoryview, *, last: bool) -> bytes:
    """One band of a raw deflate stream; bands of one stream are joined in order."""
    stream = isal_zlib.compressobj(LEVEL, isal_zlib.DEFLATED, -15)
    packed: bytes = stream.compress(data) + stream.flush(zlib.Z_FINISH if last else zlib.Z_FULL_FLUSH)
    return packed


def compress(data: bytes | memoryview) -> bytes:
    """One whole zlib stream."""
    packed: bytes = isal_zlib.compress(data, LEVEL)
    return packed


def inflate(data: bytes | memoryview, limit: int, what: str) -> bytes:
    """What a zlib stream holds; `TooLarge` where that is more than `limit` bytes, and no more are ever made."""
    stream = isal_zlib.decompressobj()
    try:
        plain: bytes = stream.decompress(data, limit + 1)
    except _Failure as failure:
        raise UnreadableImage(f"The {what} is not a deflate stream: {failure}.") from None
    if len(plain) > limit:
        raise TooLarge(f"The {what} inflates to more than {limit} bytes.", limit=limit, actual=len(plain))
    if not stream.eof:
        raise UnreadableImage(f"The {what} ends inside its deflate stream.")
    return plain
